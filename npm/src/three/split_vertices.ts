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
      for (let i = 0; i < width; i++) sum = Math.imul(sum ^ bits[from + i], 0x9e3779b1);
    }
    return sum;
  };
  const drawn = new Map<number, number>(); // by hash, or the next free number
  const firstCorners: number[] = [];
  const index = new Uint32Array(nCorners).map((_, corner) => {
    let key = hash(corner);
    let vertex = drawn.get(key);
    while (vertex !== undefined && !isSame(firstCorners[vertex], corner)) vertex = drawn.get(++key);
    if (vertex === undefined) drawn.set(key, (vertex = firstCorners.push(corner) - 1));
    return vertex;
  });
  return { index, firstCorners: Uint32Array.from(firstCorners) };
}
