// Groups the face corners that share a normal: corners of a vertex that are connected across smooth
// edges.

import type { Surface } from "../types.js";
import type { ItemLookup } from "./corners.js";

/** A table of normals, and the row that each corner uses. */
export interface NormalRows {
  readonly nRows: number;
  /** Row of each triangle corner: the number of its vertex, unless that is at a hard edge. */
  readonly cornerRows: Uint32Array;
}

/**
 * Create the normal rows of a surface.
 *
 * @param cornerOf - returns the face corner at a corner of a triangle
 */
export function createNormalRows(
  { hardEdges, triangles, faceSizes: sizes }: Surface,
  nVerts: number,
  cornerOf: ItemLookup,
): NormalRows {
  if (!hardEdges) return { nRows: nVerts, cornerRows: triangles };
  const nTriangles = triangles.length / 3;
  const vertexOf = new Uint32Array(nTriangles + 2 * (sizes?.length ?? nTriangles));
  triangles.forEach((vertex, i) => (vertexOf[cornerOf(i)] = vertex));
  const isAtHardEdge = new Uint8Array(nVerts);
  for (const vertex of hardEdges) isAtHardEdge[vertex] = 1;
  const fans = smoothFans(vertexOf, sizes, hardEdges, isAtHardEdge);
  const rowOf = new Map<number, number>(); // row of each fan at a hard edge
  let nRows = nVerts;
  const cornerRows = triangles.map((vertex, i) => {
    if (!isAtHardEdge[vertex]) return vertex;
    const fan = findRoot(fans, cornerOf(i));
    const row = rowOf.get(fan) ?? nRows++;
    rowOf.set(fan, row);
    return row;
  });
  return { nRows, cornerRows };
}

/** Union-find forest of corners that are connected across smooth edges: the parent of each. */
function smoothFans(
  vertexOf: Uint32Array,
  sizes: Uint32Array | null,
  hardEdges: Uint32Array,
  isAtHardEdge: Uint8Array,
): Uint32Array {
  const nVerts = isAtHardEdge.length;
  const hard = new Set<number>();
  for (let i = 0; i < hardEdges.length; i += 2) hard.add(hardEdges[i] * nVerts + hardEdges[i + 1]);
  const fans = vertexOf.map((_, corner) => corner);
  const firstSides = new Map<number, readonly [atLow: number, atHigh: number]>();
  const join = (one: number, other: number) => {
    fans[findRoot(fans, other)] = findRoot(fans, one);
  };
  for (let first = 0, face = 0; first < vertexOf.length; face++) {
    const end = first + (sizes?.[face] ?? 3);
    for (let corner = first; corner < end; corner++) {
      const next = corner + 1 < end ? corner + 1 : first;
      const [a, b] = [vertexOf[corner], vertexOf[next]];
      const key = Math.min(a, b) * nVerts + Math.max(a, b);
      if (a === b || !(isAtHardEdge[a] || isAtHardEdge[b]) || hard.has(key)) continue;
      const endpoints = a < b ? ([corner, next] as const) : ([next, corner] as const);
      const firstSide = firstSides.get(key);
      if (!firstSide) firstSides.set(key, endpoints);
      else endpoints.forEach((at, i) => join(firstSide[i], at));
    }
    first = end;
  }
  return fans;
}

/** Find the root of the fan of a corner, with path halving. */
function findRoot(fans: Uint32Array, corner: number): number {
  while (fans[corner] !== corner) corner = fans[corner] = fans[fans[corner]];
  return corner;
}
