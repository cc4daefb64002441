// Rows of integers from bytes, by the core.

import type { Core } from "../core/core.js";
import { int64s } from "../core/int64.js";
import { CorruptStreamError } from "../errors.js";

/**
 * Refuses bits that end before their section does.
 *
 * @throws CorruptStreamError where they do.
 */
export function requireEnd(data: Uint8Array, what: string): void {
  if (data.length && !data[data.length - 1]) {
    throw new CorruptStreamError(`the ${what} end before their section does`);
  }
}

/**
 * Rows of integers; docs/format.md, "Integers". The caller bounds the lengths.
 *
 * @param lengths - Of the rows.
 * @param tables - The table of probabilities of each row. Default: row i uses table i.
 * @throws CorruptStreamError where the bytes are not those of rows of these lengths.
 */
export function decodeIntegers(
  core: Core,
  data: Uint8Array,
  lengths: readonly number[],
  tables: readonly number[] = lengths.map((_, i) => i),
): Int32Array[] {
  const count = lengths.reduce((sum, length) => sum + length, 0);
  requireEnd(data, "integers");
  return core.during((scope) => {
    const nTables = BigInt(Math.max(...tables) + 1);
    const size = core.functions.reel_integers_memory(nTables) >>> 0;
    const values = scope.take(4 * count);
    const result = core.functions.reel_integers_decode(
      scope.take(size),
      size,
      scope.put(data),
      data.length,
      scope.put(int64s(lengths)),
      scope.put(Int32Array.from(tables)),
      BigInt(lengths.length),
      nTables,
      values,
    );
    core.checked(result, "integers");
    let start = values;
    return lengths.map((length) => {
      const row = core.int32s(start, length).slice();
      start += 4 * length;
      return row;
    });
  });
}
