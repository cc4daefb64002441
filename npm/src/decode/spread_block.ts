// A block of a track whose values corners share: each corner has that of its vertex or row.

import type { TrackValues } from "../types.js";
import type { NumberType } from "./number_types.js";
import type { PartFields, TrackBlock } from "./track_block.js";

export class SpreadBlock implements TrackBlock {
  /**
   * @param inner - The values that are shared.
   * @param spread - Which of them each corner has.
   */
  constructor(
    private readonly inner: TrackBlock,
    private readonly spread: Int32Array,
    private readonly nColumns: number,
    private readonly numbers: NumberType,
  ) {}

  get number(): number {
    return this.inner.number;
  }

  frame(time: number): TrackValues {
    const { spread, nColumns, numbers } = this;
    const values = this.inner.frame(time) as Float64Array; // or of another type, as what is found
    const length = spread.length * nColumns;
    const buffer = new ArrayBuffer(length * numbers.sizeBytes);
    const found = numbers.view(buffer, 0, length) as Float64Array;
    for (let i = 0, to = 0; i < spread.length; i++) {
      const from = spread[i] * nColumns;
      for (let k = 0; k < nColumns; k++) found[to++] = values[from + k];
    }
    return found;
  }

  fields(columns: readonly number[], first: number, nFrames: number): PartFields {
    const { spread } = this;
    const shared = this.inner.fields(columns, first, nFrames);
    const nVerts = spread.length;
    const fields = new Int16Array(shared.nModes * nVerts);
    const means = new Float64Array(shared.nModes);
    for (let k = 0; k < shared.nModes; k++) {
      const field = shared.fields.subarray(k * shared.nVerts, (k + 1) * shared.nVerts);
      let sum = 0;
      for (let i = 0; i < nVerts; i++) sum += fields[k * nVerts + i] = field[spread[i]];
      means[k] = sum / nVerts;
    }
    return { ...shared, nVerts, fields, means, ...this.corrections(shared) };
  }

  close(): void {
    this.inner.close();
  }

  /** The corrections of each corner, ascending at each frame. */
  private corrections(shared: PartFields) {
    const { correctionStarts, correctionVertices, correctionOffsets, nColumns } = shared;
    const starts = new Uint32Array(correctionStarts.length);
    const vertices: number[] = [];
    const offsets: number[] = [];
    const place = new Int32Array(shared.nVerts);
    for (let t = 0; t < shared.nFrames; t++) {
      const [from, end] = [correctionStarts[t], correctionStarts[t + 1]];
      place.fill(-1);
      for (let i = from; i < end; i++) place[correctionVertices[i]] = i;
      for (let corner = 0; from < end && corner < this.spread.length; corner++) {
        const at = place[this.spread[corner]];
        if (at < 0) continue;
        vertices.push(corner);
        for (let c = 0; c < nColumns; c++) offsets.push(correctionOffsets[at * nColumns + c]);
      }
      starts[t + 1] = vertices.length;
    }
    return {
      correctionStarts: starts,
      correctionVertices: Uint32Array.from(vertices),
      correctionOffsets: Float32Array.from(offsets),
    };
  }
}
