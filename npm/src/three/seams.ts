// Splits vertices at seams, where attributes of corners or faces differ.

import type { Attribute } from "../types.js";
import type { DomainLookup } from "./corners.js";

/** An attribute in the layout of the GPU. */
export interface VertexColumn {
  /** Name in the geometry, such as "uv". */
  readonly name: string;
  readonly domain: Attribute["domain"];
  /** Numbers per value. */
  readonly width: number;
  /** Rows of `width` numbers, one per vertex, face or corner. */
  readonly values: Float32Array;
}

/** The drawn vertices. */
export interface SplitVertices {
  /** Vertex of the file of each drawn vertex. */
  readonly sources: Uint32Array;
  /** Three vertices per triangle, in file order. */
  readonly index: Uint32Array;
  /** Attributes with `width` numbers per vertex. */
  readonly attributes: readonly { name: string; width: number; values: Float32Array }[];
}

/** Split vertices at which columns of faces or corners have several values. */
export function splitAtSeams(
  triangles: Uint32Array,
  nVerts: number,
  corners: DomainLookup,
  columns: readonly VertexColumn[],
): SplitVertices {
  const split = columns.filter((column) => column.domain !== "vertex");
  const { index, firstCorners } = split.length
    ? distinctCorners(triangles, corners, split)
    : { index: triangles, firstCorners: null };
  const sources = firstCorners
    ? firstCorners.map((corner) => triangles[corner])
    : Uint32Array.from({ length: nVerts }, (_, vertex) => vertex);
  const attributes = columns.map(({ name, domain, width, values }) => {
    const itemOf = corners(domain);
    const drawn = new Float32Array(sources.length * width);
    for (let i = 0; i < sources.length; i++) {
      const row = width * (domain === "vertex" || !firstCorners ? sources[i] : itemOf(firstCorners[i]));
      drawn.set(values.subarray(row, row + width), width * i);
    }
    return { name, width, values: drawn };
  });
  return { sources, index, attributes };
}

/** Return the drawn vertex at each corner, and the first corner of each drawn vertex. */
function distinctCorners(triangles: Uint32Array, corners: DomainLookup, columns: readonly VertexColumn[]) {
  const rows = columns.map(({ domain, width, values }) => {
    const bits = new Uint32Array(values.buffer, values.byteOffset, values.length);
    return { itemOf: corners(domain), width, bits };
  });
  const isSame = (a: number, b: number) =>
    triangles[a] === triangles[b] &&
    rows.every(({ itemOf, width, bits }) => {
      const [from, to] = [itemOf(a) * width, itemOf(b) * width];
      for (let i = 0; i < width; i++) if (bits[from + i] !== bits[to + i]) return false;
      return true;
    });
  const hash = (corner: number) => {
    let sum = mixBits(triangles[corner]);
    for (const { itemOf, width, bits } of rows) {
      const from = itemOf(corner) * width;
      for (let i = 0; i < width; i++) sum = mixBits(sum ^ bits[from + i]);
    }
    return sum;
  };
  const mask = 2 ** Math.ceil(Math.log2(2 * triangles.length + 1)) - 1;
  const table = new Int32Array(mask + 1).fill(-1); // drawn vertices, by hash
  const index = new Uint32Array(triangles.length);
  const firstCorners = new Uint32Array(triangles.length);
  let count = 0;
  for (let corner = 0; corner < triangles.length; corner++) {
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
