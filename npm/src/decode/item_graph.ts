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
  const { triangles, nTriangles, nVerts } = polygons;
  const nItems = polygons.count(domain);
  const twins = core.during((scope) => {
    const found = findTwins(core, scope, scope.put(triangles), nTriangles, nVerts);
    return core.int32s(found, triangles.length).slice();
  });
  let nEdges = 0; // with a face at each side
  for (let side = 0; side < twins.length; side++) if (twins[side] > side) nEdges++;
  const nPairs = domain === "face" ? nEdges : triangles.length + 2 * nEdges;
  if (nItems > MOST_VERTICES || nPairs > MOST_FACES) {
    throw new MeshReelError(
      `a track of ${nItems} ${domain}s is too large for a page; ${MOST_VERTICES} are possible, ` +
        `with ${MOST_FACES} edges between them (here: ${nPairs})`,
    );
  }
  const pairs = new Int32Array(2 * nPairs);
  if (domain === "face") pairFaces(twins, polygons.facesOfTriangles(), pairs);
  else pairCorners(twins, triangles, polygons.cornersOfTriangles(), pairs);
  const internalFaces = core.keeping((scope, keep) => {
    const start = keep(scope.take(12 * nPairs));
    const ends = core.int32s(start, 3 * nPairs);
    for (let i = 0; i < nPairs; i++) {
      ends[3 * i] = pairs[2 * i];
      ends[3 * i + 1] = ends[3 * i + 2] = pairs[2 * i + 1]; // a face whose second corner is double
    }
    return start;
  });
  const sequence = Int32Array.from({ length: nItems }, (_, item) => item);
  return { nVerts: nItems, nFaces: nPairs, internalFaces, sequence };
}

function pairFaces(twins: Int32Array, faces: Int32Array, pairs: Int32Array): void {
  let to = 0;
  for (let side = 0; side < twins.length; side++) {
    if (twins[side] <= side) continue;
    pairs[to++] = faces[side];
    pairs[to++] = faces[twins[side]];
  }
}

function pairCorners(
  twins: Int32Array,
  vertices: Uint32Array,
  corners: Int32Array,
  pairs: Int32Array,
): void {
  let to = 0;
  for (let side = 0; side < twins.length; side++) {
    pairs[to++] = corners[side];
    pairs[to++] = corners[ahead(side)];
  }
  for (let side = 0; side < twins.length; side++) {
    const twin = twins[side];
    if (twin <= side) continue;
    const runsBack = vertices[side] === vertices[ahead(twin)];
    const [first, second] = runsBack ? [ahead(twin), twin] : [twin, ahead(twin)];
    pairs[to++] = corners[side];
    pairs[to++] = corners[first];
    pairs[to++] = corners[ahead(side)];
    pairs[to++] = corners[second];
  }
}

/** The corner behind a corner of a triangle. */
function ahead(corner: number): number {
  return corner % 3 === 2 ? corner - 2 : corner + 1;
}
