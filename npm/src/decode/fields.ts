// Rows of small integers over the same columns from bytes, by the core.

import type { Core } from "../core/core.js";
import type { Scope } from "../core/heap.js";
import { requireEnd } from "./integers.js";

/** In which order the columns of a row are coded; addresses of arrays as core/reel.h has them. */
export interface CodingOrder {
  readonly nColumns: number;
  readonly columns: number;
  readonly nPasses: number;
  readonly passStarts: number;
  readonly nearStarts: number;
  readonly nNear: number;
  readonly near: number;
}

/**
 * The address of integers of shape (rows, columns), in the scope; docs/format.md, "Fields".
 *
 * The caller bounds both counts.
 *
 * @param order - Called once the bytes are known to end well.
 * @throws CorruptStreamError where bytes are left over.
 */
export function decodeFields(
  core: Core,
  scope: Scope,
  data: Uint8Array,
  nRows: number,
  nColumns: number,
  order: () => CodingOrder,
): number {
  requireEnd(data, "fields");
  const values = scope.take(4 * nRows * nColumns);
  const { columns, passStarts, nPasses, nearStarts, nNear, near } = order();
  core.during((inner) => {
    const passes = BigInt(nPasses);
    const counts = [BigInt(nColumns), passes, BigInt(nNear)] as const;
    const size = core.functions.reel_fields_memory(...counts) >>> 0;
    const result = core.functions.reel_fields_decode(
      inner.take(size),
      size,
      inner.put(data),
      data.length,
      BigInt(nRows),
      BigInt(nRows),
      BigInt(nColumns),
      columns,
      passStarts,
      passes,
      nearStarts,
      near,
      values,
    );
    core.checked(result, "fields");
  });
  return values;
}
