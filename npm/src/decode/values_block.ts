// A block of a track as numbers, such as one that is stored exactly; and these as small integers.

import { InvalidInputError } from "../errors.js";
import type { TrackValues } from "../types.js";
import type { NumberType } from "./number_types.js";
import type { PartFields, TrackBlock } from "./track_block.js";

/** Of an integer of 16 bits. */
const LARGEST = 32767;

/** Columns as small integers at once: each has a mode for each frame. */
const MOST_COLUMNS = 4;

export class ValuesBlock implements TrackBlock {
  private readonly middles = new Map<number, number>();

  /**
   * @param values - Of shape (T, N, C).
   * @param origin - Of each column, that small integers count from. Default: the middle of its range.
   */
  constructor(
    readonly number: number,
    private readonly nFrames: number,
    private readonly nColumns: number,
    private readonly numbers: NumberType,
    private readonly values: TrackValues,
    private readonly origin?: readonly number[],
  ) {}

  frame(time: number): TrackValues {
    const length = this.values.length / this.nFrames;
    const bytes = length * this.numbers.sizeBytes;
    const copy = this.values.buffer.slice(time * bytes, (time + 1) * bytes) as ArrayBuffer;
    return this.numbers.view(copy, 0, length);
  }

  fields(columns: readonly number[], first: number, nFrames: number): PartFields {
    const width = columns.length;
    if (width > MOST_COLUMNS) {
      throw new InvalidInputError(
        `of an exact track at most ${MOST_COLUMNS} columns are fields at once; got ${width}`,
      );
    }
    const nVerts = this.values.length / this.nFrames / this.nColumns;
    const nModes = nFrames * width + 1; // the last is 1 at all items: the middle of each frame
    const fields = new Int16Array(nModes * nVerts).fill(1, (nModes - 1) * nVerts);
    const means = new Float64Array(nModes).fill(1, nModes - 1);
    const weights = new Float32Array(nFrames * nModes * width);
    const origin = columns.map((column) => this.origin?.[column] ?? this.middleOf(column));
    const last = (t: number): number => (t * nModes + nModes - 1) * width;
    const starts = new Uint32Array(nFrames + 1);
    const vertices: number[] = [];
    const offsets: number[] = [];
    for (let t = 0; t < nFrames; t++) {
      const odd = new Map<number, number[]>();
      columns.forEach((column, c) => {
        const mode = t * width + c;
        const values = this.column(first + t, column);
        const middle = middleOf([values]) ?? origin[c];
        const away = values.map((value) => value - middle);
        const step = largestOf(away) / LARGEST || 1;
        let sum = 0;
        away.forEach((one, item) => {
          if (Number.isFinite(one)) sum += fields[mode * nVerts + item] = Math.round(one / step);
          else odd.set(item, Object.assign(odd.get(item) ?? columns.map(() => 0), { [c]: one }));
        });
        means[mode] = sum / nVerts;
        weights[(t * nModes + mode) * width + c] = step;
        weights[last(t) + c] = middle - origin[c];
      });
      for (const [item, offset] of [...odd].sort(([one], [other]) => one - other)) {
        vertices.push(item);
        offsets.push(...offset);
      }
      starts[t + 1] = vertices.length;
    }
    return {
      ...{ nFrames, nModes, nBlockModes: nModes, nVerts, nColumns: width },
      ...{ origin, fields, means, weights, correctionStarts: starts },
      correctionVertices: Uint32Array.from(vertices),
      correctionOffsets: Float32Array.from(offsets),
    };
  }

  close(): void {}

  /** Numbers of a column at a frame. */
  private column(t: number, column: number): Float64Array {
    const { values, nFrames, nColumns } = this;
    const length = values.length / nFrames;
    const found = new Float64Array(length / nColumns);
    for (let i = 0; i < found.length; i++) {
      found[i] = Number(values[t * length + i * nColumns + column]);
    }
    return found;
  }

  /** Between the least and the largest number of a column, so that those about it are small. */
  private middleOf(column: number): number {
    const known = this.middles.get(column);
    if (known !== undefined) return known;
    const frames = Array.from({ length: this.nFrames }, (_, t) => this.column(t, column));
    const found = middleOf(frames) ?? 0;
    this.middles.set(column, found);
    return found;
  }
}

/** Between the least and the largest of all finite numbers; null without one. */
function middleOf(rows: readonly Float64Array[]): number | null {
  let [low, high] = [Infinity, -Infinity];
  for (const row of rows) {
    for (const value of row) {
      if (value < low && value > -Infinity) low = value;
      if (value > high && value < Infinity) high = value;
    }
  }
  return low <= high ? low / 2 + high / 2 : null;
}

function largestOf(values: Float64Array): number {
  return values.reduce((most, value) => {
    const size = Math.abs(value);
    return size > most && size < Infinity ? size : most;
  }, 0);
}
