// The graph that values of faces or corners lie on; docs/format.md, "Tracks".

import type { Core } from "../core/core.js";
import { MeshReelError } from "../errors.js";
import { MOST_FACES, MOST_VERTICES } from "../stream/layout.js";
import type { Polygons } from "../surface/polygons.js";
import { type ItemGraph, findTwins } from "./connectivity.js";

/**
 * Faces are next to each other across an edge; corners beside each other in a triangle, and across
 * an edge at the same vertex.
 *
 * @param polygons - Of the mesh as it goes out.
 * @throws MeshReelError where there are too many for a page.
 */
export function itemGraph(core: Core, domain: "face" | "corner", polygons: Polygons): ItemGraph {
  const nItems = polygons.count(domain);
  const twins = twinsOf(core, polygons);
  const nEdges = countEdges(twins);
  const nPairs = domain === "face" ? nEdges : twins.length + 2 * nEdges;
  requireFit(`${domain}s`, nItems, nPairs);
  const pairs = new Int32Array(2 * nPairs);
  if (domain === "face") pairFaces(twins, polygons.facesOfTriangles(), pairs);
  else pairCorners(twins, polygons, pairs);
  const internalFaces = facesInMemory(core, [], pairs);
  const sequence = Int32Array.from({ length: nItems }, (_, item) => item);
  return { nVerts: nItems, nFaces: nPairs, internalFaces, sequence };
}

/**
 * Refuses a graph that a page has no memory for.
 *
 * @param nEdges - Between its items, or triangles of them.
 * @throws MeshReelError
 */
export function requireFit(what: string, nItems: number, nEdges: number): void {
  if (nItems <= MOST_VERTICES && nEdges <= MOST_FACES) return;
  throw new MeshReelError(
    `a track of ${nItems} ${what} is too large for a page; ${MOST_VERTICES} are possible, ` +
      `with ${MOST_FACES} edges between them (here: ${nEdges})`,
  );
}

function pairFaces(twins: Int32Array, faces: Int32Array, pairs: Int32Array): void {
  let to = 0;
  for (let side = 0; side < twins.length; side++) {
    if (twins[side] <= side) continue;
    pairs[to++] = faces[side];
    pairs[to++] = faces[twins[side]];
  }
}

function pairCorners(twins: Int32Array, polygons: Polygons, pairs: Int32Array): void {
  const corners = polygons.cornersOfTriangles();
  for (let side = 0; side < twins.length; side++) {
    pairs[2 * side] = corners[side];
    pairs[2 * side + 1] = corners[ahead(side)];
  }
  pairAcross(twins, polygons, corners, pairs.subarray(2 * twins.length));
}

/**
 * Corners at each corner of a triangle; and pairs of those that are next to each other across an
 * edge, at the same vertex where its faces agree on that.
 */
export function cornersAcross(core: Core, polygons: Polygons) {
  const twins = twinsOf(core, polygons);
  const corners = polygons.cornersOfTriangles();
  const across = new Int32Array(4 * countEdges(twins));
  pairAcross(twins, polygons, corners, across);
  return { corners, across };
}

function pairAcross(
  twins: Int32Array,
  { triangles }: Polygons,
  corners: Int32Array,
  pairs: Int32Array,
): void {
  let to = 0;
  for (let side = 0; side < twins.length; side++) {
    const twin = twins[side];
    if (twin <= side) continue;
    const runsBack = triangles[side] === triangles[ahead(twin)];
    const [first, second] = runsBack ? [ahead(twin), twin] : [twin, ahead(twin)];
    pairs[to++] = corners[side];
    pairs[to++] = corners[first];
    pairs[to++] = corners[ahead(side)];
    pairs[to++] = corners[second];
  }
}

/** The opposite side of each side of each triangle. */
function twinsOf(core: Core, { triangles, nTriangles, nVerts }: Polygons): Int32Array {
  return core.during((scope) => {
    const found = findTwins(core, scope, scope.put(triangles), nTriangles, nVerts);
    return core.int32s(found, triangles.length).slice();
  });
}

/** Edges with a triangle at each side. */
function countEdges(twins: Int32Array): number {
  let found = 0;
  for (let side = 0; side < twins.length; side++) if (twins[side] > side) found++;
  return found;
}

/**
 * The address of faces of a graph: triangles, and pairs as faces whose second corner is double.
 * Whoever asks gives them back.
 */
export function facesInMemory(
  core: Core,
  triangles: ArrayLike<number>,
  pairs: ArrayLike<number>,
): number {
  const nPairs = pairs.length / 2;
  return core.keeping((scope, keep) => {
    const start = keep(scope.take(4 * triangles.length + 12 * nPairs));
    core.int32s(start, triangles.length).set(triangles);
    const ends = core.int32s(start + 4 * triangles.length, 3 * nPairs);
    for (let i = 0; i < nPairs; i++) {
      ends[3 * i] = pairs[2 * i];
      ends[3 * i + 1] = ends[3 * i + 2] = pairs[2 * i + 1];
    }
    return start;
  });
}

/** The corner behind a corner of a triangle. */
function ahead(corner: number): number {
  return corner % 3 === 2 ? corner - 2 : corner + 1;
}
