// A block of a further track that is coded by modes, some of whose numbers may be missing.

import type { Core } from "../core/core.js";
import type { TrackFields, TrackValues } from "../types.js";
import { fieldsOf } from "./block_fields.js";
import type { DecodedBlock } from "./decoded_block.js";
import { type Positions, ofUnitLength, valuesOf } from "./frames.js";
import type { Track } from "./track.js";

/** Fields of some frames of a block. */
export type PartFields = Omit<TrackFields, "number" | "start">;

/** A block of a further track, decoded. */
export interface TrackBlock {
  readonly number: number;
  /** Values of a frame of the block, of shape (N, C). */
  frame(time: number): TrackValues;
  /** Some columns as small integers, at some frames of the block. */
  fields(columns: readonly number[], first: number, nFrames: number): PartFields;
  /** Gives its memory back. */
  close(): void;
}

/** How the numbers of a track with modes lie in their range. */
export type Placed = Track & { readonly placement: NonNullable<Track["placement"]> };

/** A block that is coded by modes. */
export class ModesBlock implements TrackBlock {
  /**
   * @param missing - Of shape (T, N, C), 1 for each number that is missing; null: all are there.
   */
  constructor(
    private readonly core: Core,
    private readonly track: Placed,
    private readonly block: DecodedBlock,
    private readonly missing: Uint8Array | null,
  ) {}

  get number(): number {
    return this.block.number;
  }

  frame(time: number): Positions {
    const { core, track, block, missing } = this;
    const values = valuesOf(core, track.placement, block, time);
    if (track.kind === "normal") ofUnitLength(values);
    if (missing) {
      const from = time * values.length;
      for (let i = 0; i < values.length; i++) if (missing[from + i]) values[i] = NaN;
    }
    return values;
  }

  fields(columns: readonly number[], first: number, nFrames: number): PartFields {
    const { scale, origin } = this.track.placement;
    const all = fieldsOf(this.core, scale, this.block);
    const places = columns.map((column) => origin[column]);
    const { correctionOffsets, weights } = all;
    const found = {
      ...all,
      nColumns: columns.length,
      origin: places,
      weights: columnsOf(weights, origin.length, columns),
      correctionOffsets: columnsOf(correctionOffsets, origin.length, columns),
    };
    const { missing } = this;
    const whole = missing ? withMissing(found, missing, origin.length, columns) : found;
    return nFrames < whole.nFrames ? partOf(whole, first, nFrames) : whole;
  }

  close(): void {
    this.block.close();
  }
}

/** The fields at some frames. */
function partOf(fields: TrackFields, first: number, nFrames: number): PartFields {
  const { nModes, nColumns, weights } = fields;
  const { correctionStarts, correctionVertices, correctionOffsets } = fields;
  const end = first + nFrames;
  const starts = correctionStarts.slice(first, end + 1);
  const [from, to] = [starts[0], starts[nFrames]];
  return {
    ...{ ...fields, nFrames },
    weights: weights.slice(nModes * nColumns * first, nModes * nColumns * end),
    correctionStarts: starts.map((start) => start - from),
    correctionVertices: correctionVertices.slice(from, to),
    correctionOffsets: correctionOffsets.slice(nColumns * from, nColumns * to),
  };
}

function columnsOf(
  rows: Float32Array,
  width: number,
  columns: readonly number[],
): Float32Array {
  const found = new Float32Array((rows.length / width) * columns.length);
  for (let i = 0, to = 0; i < rows.length; i += width) {
    for (const column of columns) found[to++] = rows[i + column];
  }
  return found;
}

/** Numbers that are missing have NaN for their correction. */
function withMissing(
  fields: TrackFields,
  missing: Uint8Array,
  nColumns: number,
  columns: readonly number[],
): TrackFields {
  const { nFrames, nVerts, correctionStarts, correctionVertices, correctionOffsets } = fields;
  const width = columns.length;
  const starts = new Uint32Array(nFrames + 1);
  const vertices: number[] = [];
  const offsets: number[] = [];
  for (let t = 0; t < nFrames; t++) {
    let next = correctionStarts[t];
    for (let item = 0; item < nVerts; item++) {
      const isCorrected = next < correctionStarts[t + 1] && correctionVertices[next] === item;
      const from = (t * nVerts + item) * nColumns;
      if (isCorrected || columns.some((column) => missing[from + column])) {
        vertices.push(item);
        columns.forEach((column, c) => {
          const offset = isCorrected ? correctionOffsets[next * width + c] : 0;
          offsets.push(missing[from + column] ? NaN : offset);
        });
      }
      if (isCorrected) next++;
    }
    starts[t + 1] = vertices.length;
  }
  return {
    ...fields,
    correctionStarts: starts,
    correctionVertices: Uint32Array.from(vertices),
    correctionOffsets: Float32Array.from(offsets),
  };
}
