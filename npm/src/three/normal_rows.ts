// Which corners of faces share a normal: at a vertex, those joined across edges that are not hard.

import type { Surface } from "../types.js";
import { cornersOf } from "./corners.js";

/** Normals of a mesh with hard edges, one for each row. */
export interface NormalRows {
  /** The row of each corner of the faces; of most corners it is their vertex. */
  readonly ofCorner: Uint32Array<ArrayBuffer>;
  /** The vertex of each row. */
  readonly vertices: Uint32Array;
  /** Triangles in rows: the one of each of their corners. */
  readonly triangles: Uint32Array;
}

/** The rows of a surface of `nVerts` vertices; null where no edge is hard. */
export function normalRowsOf(surface: Surface, nVerts: number): NormalRows | null {
  const { hardEdges, triangles } = surface;
  if (!hardEdges) return null;
  const itemOf = cornersOf(surface)("corner");
  const nTriangles = triangles.length / 3;
  const sizes = surface.faceSizes;
  const vertexOf = new Uint32Array(nTriangles + 2 * (sizes?.length ?? nTriangles));
  for (let i = 0; i < triangles.length; i++) vertexOf[itemOf(i)] = triangles[i];
  const isSplit = new Uint8Array(nVerts);
  for (const vertex of hardEdges) isSplit[vertex] = 1;
  const fans = smoothFans(vertexOf, sizes, hardEdges, isSplit);
  const vertices = Array.from({ length: nVerts }, (_, vertex) => vertex);
  const rowOf = new Map<number, number>(); // of each fan of a vertex at a hard edge
  const hasRow = new Uint8Array(nVerts);
  const ofCorner = vertexOf.map((vertex, corner) => {
    if (!isSplit[vertex]) return vertex;
    const fan = rootOf(fans, corner);
    let row = rowOf.get(fan);
    if (row === undefined) {
      row = hasRow[vertex] ? vertices.push(vertex) - 1 : vertex;
      hasRow[vertex] = 1;
      rowOf.set(fan, row);
    }
    return row;
  });
  return {
    ofCorner,
    vertices: Uint32Array.from(vertices),
    triangles: triangles.map((_, i) => ofCorner[itemOf(i)]),
  };
}

/** Corners that are joined across edges that are not hard, as a forest: the parent of each. */
function smoothFans(
  vertexOf: Uint32Array,
  sizes: Uint32Array | null,
  hardEdges: Uint32Array,
  isSplit: Uint8Array,
): Uint32Array {
  const nVerts = isSplit.length;
  const hard = new Set<number>();
  for (let i = 0; i < hardEdges.length; i += 2) hard.add(hardEdges[i] * nVerts + hardEdges[i + 1]);
  const fans = vertexOf.map((_, corner) => corner);
  const firstSides = new Map<number, readonly [atLow: number, atHigh: number]>();
  const join = (one: number, other: number) => {
    fans[rootOf(fans, other)] = rootOf(fans, one);
  };
  for (let first = 0, face = 0; first < vertexOf.length; face++) {
    const behind = first + (sizes?.[face] ?? 3);
    for (let corner = first; corner < behind; corner++) {
      const next = corner + 1 < behind ? corner + 1 : first;
      const [a, b] = [vertexOf[corner], vertexOf[next]];
      const key = Math.min(a, b) * nVerts + Math.max(a, b);
      if (a === b || !(isSplit[a] || isSplit[b]) || hard.has(key)) continue;
      const side = a < b ? ([corner, next] as const) : ([next, corner] as const);
      const before = firstSides.get(key);
      if (!before) firstSides.set(key, side);
      else side.forEach((at, i) => join(before[i], at));
    }
    first = behind;
  }
  return fans;
}

/** The corner that stands for the fan of a corner; ways to it are halved as they are gone. */
function rootOf(fans: Uint32Array, corner: number): number {
  while (fans[corner] !== corner) corner = fans[corner] = fans[fans[corner]];
  return corner;
}
