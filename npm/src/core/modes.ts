// A track in a block as a sum of modes, in the memory of the library.

import type { Library } from "./library.js";
import { Struct } from "./struct.js";

const STRUCT_BYTES = 128;

/**
 * A track in a block: the formula is that of `meshreel_modes` in include/meshreel.h. `values` is a
 * view of memory that lasts until the library is called again; the rest are copies.
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
  /** Rows of nModes numbers, in steps. */
  readonly values: Float64Array;
  /** The row of each item. */
  readonly rows: Int32Array;
  /** Of shape (nColumns, nFrames, nModes). */
  readonly basis: Float64Array;
  /** Corrections of frame t are starts[t] .. starts[t + 1] - 1, items ascending. */
  readonly starts: Uint32Array;
  readonly corrected: Uint32Array;
  /** nColumns for each. */
  readonly corrections: Float64Array;
}

/**
 * The modes of a track in a block, of each of its items; null where it is no sum of modes. Throws as
 * `Library.check`.
 */
export function readModes(
  library: Library,
  decoder: number,
  track: number,
  block: number,
  nItems: number,
): Modes | null {
  return library.during(STRUCT_BYTES, (at) => {
    library.check((error) =>
      library.functions.meshreel_modes_of(decoder, track, block, at, error),
    );
    const { buffer } = library;
    const found = new Struct(buffer, at);
    const [nFrames, nModes, nColumns, nStored, hasMissing] = found.uint32s(6);
    if (!nModes) return null;
    const [step, scale] = found.float64s(2);
    const [origin, values, rows, basis, shared, starts, corrected, corrections] = found.uint32s(8);
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
    return shared ? spread(modes, new Int32Array(buffer, shared, nItems)) : modes;
  });
}

/** Modes of items that share those of others, with corrections of each. */
function spread(modes: Modes, shared: Int32Array): Modes {
  const { nFrames, nItems, nColumns, starts, corrected, corrections } = modes;
  const found = new Uint32Array(nFrames + 1);
  const items: number[] = [];
  const numbers: number[] = [];
  const places = new Int32Array(nItems);
  for (let t = 0; t < nFrames; t++) {
    const [from, end] = [starts[t], starts[t + 1]];
    places.fill(-1);
    for (let i = from; i < end; i++) places[corrected[i]] = i;
    for (let item = 0; from < end && item < shared.length; item++) {
      const place = places[shared[item]];
      if (place < 0) continue;
      items.push(item);
      for (let c = 0; c < nColumns; c++) numbers.push(corrections[place * nColumns + c]);
    }
    found[t + 1] = items.length;
  }
  return {
    ...modes,
    nItems: shared.length,
    rows: shared.map((item) => modes.rows[item]),
    starts: found,
    corrected: Uint32Array.from(items),
    corrections: Float64Array.from(numbers),
  };
}
