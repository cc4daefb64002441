// The vertices that are drawn: those of the file, split where values of corners differ.

import type { Attribute } from "../types.js";
import type { Corners } from "./corners.js";

/** Values of an attribute of a mesh, as a GPU takes them. */
export interface Column {
  /** Such as "uv". */
  readonly name: string;
  readonly domain: Attribute["domain"];
  /** Numbers of a value. */
  readonly width: number;
  /** Rows of `width` numbers, one for each vertex, face or corner. */
  readonly values: Float32Array;
}

/** The vertices that are drawn. */
export interface DrawnVertices {
  /** The vertex of the file that each one is. */
  readonly sources: Uint32Array;
  /** The three of each triangle, in the order of the file. */
  readonly index: Uint32Array;
  /** Values of each, `width` numbers a vertex. */
  readonly attributes: readonly { name: string; width: number; values: Float32Array }[];
}

/** Splits vertices where columns of faces or corners have several values at one. */
export function splitAtSeams(
  triangles: Uint32Array,
  nVerts: number,
  corners: Corners,
  columns: readonly Column[],
): DrawnVertices {
  const split = columns.filter((column) => column.domain !== "vertex");
  const { index, firsts } = split.length
    ? distinctCorners(triangles, corners, split)
    : { index: triangles, firsts: null };
  const sources = firsts
    ? firsts.map((corner) => triangles[corner])
    : Uint32Array.from({ length: nVerts }, (_, vertex) => vertex);
  const attributes = columns.map(({ name, domain, width, values }) => {
    const itemOf = corners(domain);
    const drawn = new Float32Array(sources.length * width);
    for (let i = 0; i < sources.length; i++) {
      const row = width * (domain === "vertex" || !firsts ? sources[i] : itemOf(firsts[i]));
      drawn.set(values.subarray(row, row + width), width * i);
    }
    return { name, width, values: drawn };
  });
  return { sources, index, attributes };
}

/** The number of the vertex drawn at each corner, and the first corner of each of them. */
function distinctCorners(triangles: Uint32Array, corners: Corners, columns: readonly Column[]) {
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
    let sum = mixed(triangles[corner]);
    for (const { itemOf, width, bits } of rows) {
      const from = itemOf(corner) * width;
      for (let i = 0; i < width; i++) sum = mixed(sum ^ bits[from + i]);
    }
    return sum;
  };
  const mask = 2 ** Math.ceil(Math.log2(2 * triangles.length + 1)) - 1;
  const table = new Int32Array(mask + 1).fill(-1); // numbers of drawn vertices, by hash
  const index = new Uint32Array(triangles.length);
  const firsts = new Uint32Array(triangles.length);
  let count = 0;
  for (let corner = 0; corner < triangles.length; corner++) {
    let slot = hash(corner) & mask;
    while (table[slot] >= 0 && !isSame(firsts[table[slot]], corner)) slot = (slot + 1) & mask;
    if (table[slot] < 0) {
      firsts[count] = corner;
      table[slot] = count++;
    }
    index[corner] = table[slot];
  }
  return { index, firsts: firsts.slice(0, count) };
}

function mixed(bits: number): number {
  const half = Math.imul(bits ^ (bits >>> 16), 0x85ebca6b);
  const most = Math.imul(half ^ (half >>> 13), 0xc2b2ae35);
  return (most ^ (most >>> 16)) + 0x9e3779b9;
}
