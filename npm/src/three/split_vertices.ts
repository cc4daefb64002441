// Splits vertices at seams, where values of corners or faces differ.

import type { ItemLookup } from "./corners.js";

/** Values at the corners of triangles. */
export interface Column {
  /** Numbers per value. */
  readonly width: number;
  /** Rows of `width` numbers, one per item. */
  readonly values: Float32Array | Uint32Array;
  /** Returns the item at a corner. */
  readonly itemOf: ItemLookup;
}

/** Return the drawn vertex at each corner, and the first corner of each drawn vertex. */
export function splitVertices(columns: readonly Column[], nCorners: number) {
  const rows = columns.map(({ values, ...rest }) => {
    // Compared by bits, so that NaN equals itself.
    return { ...rest, bits: new Uint32Array(values.buffer, values.byteOffset, values.length) };
  });
  const isSame = (a: number, b: number) =>
    rows.every(({ itemOf, width, bits }) => {
      const [from, to] = [itemOf(a) * width, itemOf(b) * width];
      for (let i = 0; i < width; i++) if (bits[from + i] !== bits[to + i]) return false;
      return true;
    });
  const hash = (corner: number) => {
    let sum = 0;
    for (const { itemOf, width, bits } of rows) {
      const from = itemOf(corner) * width;
      for (let i = 0; i < width; i++) sum = mixBits(sum ^ bits[from + i]);
    }
    return sum;
  };
  const mask = 2 ** Math.ceil(Math.log2(2 * nCorners + 1)) - 1;
  const table = new Int32Array(mask + 1).fill(-1); // drawn vertices, by hash
  const index = new Uint32Array(nCorners);
  const firstCorners = new Uint32Array(nCorners);
  let count = 0;
  for (let corner = 0; corner < nCorners; corner++) {
    let slot = hash(corner) & mask;
    while (table[slot] >= 0 && !isSame(firstCorners[table[slot]], corner)) slot = (slot + 1) & mask;
    if (table[slot] < 0) {
      firstCorners[count] = corner;
      table[slot] = count++;
    }
    index[corner] = table[slot];
  }
  return { index, firstCorners: firstCorners.slice(0, count) };
}

function mixBits(bits: number): number {
  const half = Math.imul(bits ^ (bits >>> 16), 0x85ebca6b);
  const mixedBits = Math.imul(half ^ (half >>> 13), 0xc2b2ae35);
  return (mixedBits ^ (mixedBits >>> 16)) + 0x9e3779b9;
}
