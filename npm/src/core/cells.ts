// Cuts through volume meshes: the surface of the cells on one side of a plane.

import type { CellPolygons, Cells, CutPlane, Positions } from "../types.js";
import type { Library } from "./library.js";

const N_TYPES = 256;

/** Return the polygons of the cells whose center, the mean of their nodes, is not beyond a plane. */
export function cutCells(
  library: Library,
  { types, nodes }: Cells,
  positions: Positions,
  { normal: [x, y, z], offset }: CutPlane,
): CellPolygons {
  const sizeOf = Array.from({ length: N_TYPES }, (_, type) =>
    Number(library.functions.reel_cell_size(BigInt(type))),
  );
  const kept: number[] = [];
  const keptNodes: number[] = [];
  let start = 0;
  types.forEach((type, cell) => {
    const own = nodes.subarray(start, (start += sizeOf[type]));
    let sum = 0;
    for (const node of own) {
      sum += x * positions[3 * node] + y * positions[3 * node + 1] + z * positions[3 * node + 2];
    }
    if (sum > offset * own.length) return;
    kept.push(cell);
    for (const node of own) keptNodes.push(node);
  });
  const keptTypes = Uint8Array.from(kept, (cell) => types[cell]);
  const polygons = polygonsOf(library, keptTypes, Uint32Array.from(keptNodes), positions.length / 3);
  return { ...polygons, faceCells: polygons.faceCells.map((cell) => kept[cell]) };
}

/** Return the polygons of cells, which belong to cells in the order of `types`. */
function polygonsOf(
  library: Library,
  types: Uint8Array,
  nodes: Uint32Array,
  nVerts: number,
  capacity = 0,
): CellPolygons {
  const { functions } = library;
  const counts = [types.length, nVerts].map(BigInt);
  const workBytes = functions.reel_cells_memory(counts[0], counts[1]) >>> 0;
  const parts = [workBytes, nodes.byteLength, 12 * capacity, 4 * capacity, 4 * capacity, 8, types.length];
  let end = 0;
  const places = parts.map((size) => (end += 8 * Math.ceil(size / 8)) - 8 * Math.ceil(size / 8));
  const found = library.withMemory(end, (address) => {
    const [work, ofNodes, triangles, sizes, owners, count, ofTypes] = places.map((at) => address + at);
    new Uint32Array(library.buffer, ofNodes, nodes.length).set(nodes);
    new Uint8Array(library.buffer, ofTypes, types.length).set(types);
    const nTriangles = Number(
      functions.reel_cells_surface(
        work, workBytes, ofTypes, counts[0], ofNodes, BigInt(nodes.length), counts[1],
        BigInt(capacity), triangles, sizes, owners, count,
      ),
    );
    if (nTriangles > capacity) return nTriangles;
    const [nPolygons] = new Uint32Array(library.buffer, count, 1);
    const [ofTriangles, faceSizes, faceCells] = [
      [triangles, 3 * nTriangles],
      [sizes, nPolygons],
      [owners, nPolygons],
    ].map(([at, length]) => new Uint32Array(library.buffer, at, length).slice());
    return { triangles: ofTriangles, faceSizes, faceCells };
  });
  return typeof found === "number" ? polygonsOf(library, types, nodes, nVerts, found) : found;
}
