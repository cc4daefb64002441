// Modes of a track in a block, read from the memory of the library.

import type { Library } from "./library.js";
import { Struct } from "./struct.js";

const STRUCT_BYTES = 128;

/**
 * A track in a block as a sum of modes; `meshreel_modes` in include/meshreel.h has the formula.
 * `values` is a view that is valid until the next call of the library; the rest are copies.
 */
export interface Modes {
  readonly nFrames: number;
  readonly nModes: number;
  readonly nColumns: number;
  readonly nItems: number;
  readonly hasMissing: boolean;
  readonly step: number;
  readonly scale: number;
  readonly origin: readonly number[];
  /** Fields, in quantization steps: rows of nModes numbers. */
  readonly values: Float64Array;
  /** Row of each item in `values`. */
  readonly rows: Int32Array;
  /** Temporal basis, of shape (nColumns, nFrames, nModes). */
  readonly basis: Float64Array;
  /** Corrections of frame t are starts[t] .. starts[t + 1] - 1, by ascending item. */
  readonly starts: Uint32Array;
  /** Item of each correction. */
  readonly corrected: Uint32Array;
  /** nColumns numbers per correction. */
  readonly corrections: Float64Array;
}

/**
 * Read the modes of a track in a block; null if the block is not stored as modes. Throws as
 * `Library.check`.
 */
export function readModes(
  library: Library,
  decoder: number,
  track: number,
  block: number,
  nItems: number,
): Modes | null {
  return library.withMemory(STRUCT_BYTES, (address) => {
    library.check((error) =>
      library.functions.meshreel_modes_of(decoder, track, block, address, error),
    );
    const { buffer } = library;
    const fields = new Struct(buffer, address);
    const [nFrames, nModes, nColumns, nStored, hasMissing] = fields.uint32s(6);
    if (!nModes) return null;
    const [step, scale] = fields.float64s(2);
    const [origin, values, rows, basis, shared, starts, corrected, corrections] = fields.uint32s(8);
    const modes = {
      ...{ nFrames, nModes, nColumns, nItems: nStored, hasMissing: hasMissing !== 0, step, scale },
      origin: [...new Float64Array(buffer, origin, nColumns)],
      values: new Float64Array(buffer, values, nStored * nModes),
      rows: new Int32Array(buffer, rows, nStored).slice(),
      basis: new Float64Array(buffer, basis, nColumns * nFrames * nModes).slice(),
      starts: new Uint32Array(nFrames + 1),
      corrected: new Uint32Array(0),
      corrections: new Float64Array(0),
    };
    if (starts) {
      modes.starts = Uint32Array.from(new BigInt64Array(buffer, starts, nFrames + 1), Number);
      const count = modes.starts[nFrames];
      modes.corrected = Uint32Array.from(new Int32Array(buffer, corrected, count));
      modes.corrections = new Float64Array(buffer, corrections, count * nColumns).slice();
    }
    return shared ? expandShared(modes, new Int32Array(buffer, shared, nItems)) : modes;
  });
}

/** Expand modes of shared items: item i gets the modes and corrections of item shared[i]. */
function expandShared(modes: Modes, shared: Int32Array): Modes {
  const { nFrames, nItems, nColumns, starts, corrected, corrections } = modes;
  const expandedStarts = new Uint32Array(nFrames + 1);
  const items: number[] = [];
  const offsets: number[] = [];
  const correctionOf = new Int32Array(nItems); // -1: none
  for (let t = 0; t < nFrames; t++) {
    const [from, end] = [starts[t], starts[t + 1]];
    correctionOf.fill(-1);
    for (let i = from; i < end; i++) correctionOf[corrected[i]] = i;
    for (let item = 0; from < end && item < shared.length; item++) {
      const correction = correctionOf[shared[item]];
      if (correction < 0) continue;
      items.push(item);
      for (let c = 0; c < nColumns; c++) offsets.push(corrections[correction * nColumns + c]);
    }
    expandedStarts[t + 1] = items.length;
  }
  return {
    ...modes,
    nItems: shared.length,
    rows: shared.map((item) => modes.rows[item]),
    starts: expandedStarts,
    corrected: Uint32Array.from(items),
    corrections: Float64Array.from(offsets),
  };
}
