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
  if (!(nHard >= 1 && nHard <= edges.length / 2)) {
    throw new CorruptStreamError(`${nHard} of ${edges.length / 2} edges between faces are hard`);
  }
  const [between] = decodeIntegers(core, reader.rest(), [nHard]);
  const found = new Uint32Array(2 * nHard);
  let number = -1;
  for (let i = 0; i < nHard; i++) {
    number += between[i] + 1;
    if (between[i] < 0 || 2 * number >= edges.length) {
      throw new CorruptStreamError("a hard edge is none of those between faces");
    }
    found.set([edges[2 * number], edges[2 * number + 1]], 2 * i);
  }
  return found;
}

/** Edges that two sides of faces or more lie on: pairs of vertices, in the order of their sides. */
export function sharedEdges(polygons: Polygons): Uint32Array {
  const vertices = polygons.verticesOfCorners();
  const nCorners = vertices.length;
  const ends = new Uint32Array(2 * nCorners); // of each edge, in the order of its first side
  const nSides = new Uint32Array(nCorners);
  const mask = 2 ** Math.ceil(Math.log2(2 * nCorners + 1)) - 1;
  const table = new Int32Array(mask + 1).fill(-1); // numbers of edges, by hash
  let nEdges = 0;
  let first = 0;
  for (let face = 0; face < polygons.nFaces; face++) {
    const behind = first + (polygons.sizes?.[face] ?? 3);
    for (let corner = first; corner < behind; corner++) {
      const other = vertices[corner + 1 < behind ? corner + 1 : first];
      const low = Math.min(vertices[corner], other);
      const high = Math.max(vertices[corner], other);
      if (low === high) continue;
      let slot = hash(low, high) & mask;
      while (table[slot] >= 0 && !isEdge(ends, table[slot], low, high)) slot = (slot + 1) & mask;
      if (table[slot] < 0) {
        ends.set([low, high], 2 * nEdges);
        table[slot] = nEdges++;
      }
      nSides[table[slot]]++;
    }
    first = behind;
  }
  let nShared = 0;
  for (let edge = 0; edge < nEdges; edge++) {
    if (nSides[edge] > 1) ends.copyWithin(2 * nShared++, 2 * edge, 2 * edge + 2);
  }
  return ends.slice(0, 2 * nShared);
}

function isEdge(ends: Uint32Array, edge: number, low: number, high: number): boolean {
  return ends[2 * edge] === low && ends[2 * edge + 1] === high;
}

function hash(low: number, high: number): number {
  const mixed = Math.imul(low ^ Math.imul(high, 0x85ebca6b), 0xc2b2ae35);
  return mixed ^ (mixed >>> 15);
}
