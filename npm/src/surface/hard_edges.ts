// Hard edges of a mesh: those across which faces do not share normals.

import type { Core } from "../core/core.js";
import { decodeIntegers } from "../decode/integers.js";
import { CorruptStreamError } from "../errors.js";
import { ByteReader } from "../stream/byte_reader.js";
import type { Polygons } from "./polygons.js";

/**
 * Pairs of vertices of hard edges, from the payload of HARD_EDGES.
 *
 * @throws CorruptStreamError where one is none of those between faces.
 */
export function readHardEdges(core: Core, payload: Uint8Array, polygons: Polygons): Uint32Array {
  const reader = new ByteReader(payload);
  const edges = sharedEdges(polygons);
  const nHard = reader.varint();
  if (!(nHard >= 1 && nHard <= edges.length)) {
    throw new CorruptStreamError(`${nHard} of ${edges.length} edges between faces are hard`);
  }
  const [between] = decodeIntegers(core, reader.rest(), [nHard]);
  const found = new Uint32Array(2 * nHard);
  let number = -1;
  for (let i = 0; i < nHard; i++) {
    number += between[i] + 1;
    if (between[i] < 0 || number >= edges.length) {
      throw new CorruptStreamError("a hard edge is none of those between faces");
    }
    found.set(edges[number], 2 * i);
  }
  return found;
}

/** Edges that two sides of faces or more lie on, in the order of their first sides. */
function sharedEdges(polygons: Polygons): (readonly [low: number, high: number])[] {
  const { nFaces, nVerts, sizes } = polygons;
  const vertices = polygons.verticesOfCorners();
  const nSides = new Map<number, number>(); // a map keeps the order
  for (let face = 0, first = 0; face < nFaces; face++) {
    const behind = first + (sizes?.[face] ?? 3);
    for (let corner = first; corner < behind; corner++) {
      const one = vertices[corner];
      const other = vertices[corner + 1 < behind ? corner + 1 : first];
      const edge = Math.min(one, other) * nVerts + Math.max(one, other);
      if (one !== other) nSides.set(edge, (nSides.get(edge) ?? 0) + 1);
    }
    first = behind;
  }
  return [...nSides]
    .filter(([, count]) => count > 1)
    .map(([edge]) => [Math.floor(edge / nVerts), edge % nVerts]);
}
