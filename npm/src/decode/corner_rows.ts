// Corners of faces that always have equal values; docs/format.md, "Corners that share values".

import type { Core } from "../core/core.js";
import { CorruptStreamError } from "../errors.js";
import { ByteReader } from "../stream/byte_reader.js";
import type { Polygons } from "../surface/polygons.js";
import { type ItemGraph, inverse } from "./connectivity.js";
import { decodeIntegers } from "./integers.js";
import { cornersAcross, facesInMemory, requireFit } from "./item_graph.js";

/** Codes of rows: that of the corner before at the vertex; the next new one. */
const AGAIN = 0;
const NEW = 1;

/** The rows of corners. */
export interface CornerRows {
  readonly nRows: number;
  /** The row of each corner. */
  readonly ofCorners: Int32Array;
  /** The vertex of each row, as it goes out. */
  readonly vertices: Int32Array;
}

/**
 * The rows that a section TRACK says.
 *
 * @param sequence - Internal number of each vertex that goes out.
 * @throws CorruptStreamError where they are not those of the corners of these polygons.
 */
export function readCornerRows(
  core: Core,
  payload: Uint8Array,
  polygons: Polygons,
  sequence: Int32Array,
): CornerRows {
  const vertexOf = polygons.verticesOfCorners();
  const nVerts = sequence.length;
  const reader = new ByteReader(payload);
  const nStored = reader.varint();
  if (nStored > vertexOf.length) throw wrongCount();
  const [hasSeam, codes] = decodeIntegers(core, reader.rest(), [nVerts, nStored]);
  if (hasSeam.some((one) => one !== 0 && one !== 1)) {
    throw new CorruptStreamError("a vertex neither has a seam nor has none");
  }
  const { starts, corners } = cornersByVertex(vertexOf, sequence);
  const ofCorners = new Int32Array(vertexOf.length);
  let next = 0;
  let nRows = nVerts;
  for (let vertex = 0; vertex < nVerts; vertex++) {
    const first = starts[vertex];
    for (let i = first; i < starts[vertex + 1]; i++) {
      const isStored = hasSeam[vertex] && i > first;
      if (isStored && next === nStored) throw wrongCount();
      const code = isStored ? codes[next++] : AGAIN;
      const before = i - Math.max(code, 1);
      if (code === NEW) ofCorners[corners[i]] = nRows++;
      else if (i === first) ofCorners[corners[i]] = vertex;
      else if (code >= AGAIN && before >= first) ofCorners[corners[i]] = ofCorners[corners[before]];
      else {
        throw new CorruptStreamError(
          "a corner has the row of a corner that its vertex does not have",
        );
      }
    }
  }
  if (next !== nStored) throw wrongCount();
  const vertices = new Int32Array(nRows);
  vertices.set(inverse(sequence));
  ofCorners.forEach((row, corner) => (vertices[row] = vertexOf[corner]));
  return { nRows, ofCorners, vertices };
}

/**
 * The graph of rows: two are next to each other if corners of theirs are.
 *
 * @throws MeshReelError where there are too many for a page.
 */
export function rowGraph(
  core: Core,
  { nRows, ofCorners }: CornerRows,
  polygons: Polygons,
): ItemGraph {
  const { corners, across } = cornersAcross(core, polygons);
  const joined: number[] = [];
  for (let i = 0; i < across.length; i += 2) {
    const [one, other] = [ofCorners[across[i]], ofCorners[across[i + 1]]];
    if (one !== other) joined.push(one, other);
  }
  const triangles = corners.map((corner) => ofCorners[corner]);
  const nFaces = triangles.length / 3 + joined.length / 2;
  requireFit("values of corners", nRows, nFaces);
  const internalFaces = facesInMemory(core, triangles, joined);
  const sequence = Int32Array.from({ length: nRows }, (_, row) => row);
  return { nVerts: nRows, nFaces, internalFaces, sequence };
}

/** Corners by the internal numbers of their vertices, ascending, and where those of each begin. */
function cornersByVertex(vertexOf: Uint32Array, sequence: Int32Array) {
  const starts = new Int32Array(sequence.length + 1);
  for (const vertex of vertexOf) starts[sequence[vertex] + 1]++;
  for (let i = 0; i < sequence.length; i++) starts[i + 1] += starts[i];
  const ends = starts.slice();
  const corners = new Int32Array(vertexOf.length);
  vertexOf.forEach((vertex, corner) => (corners[ends[sequence[vertex]]++] = corner));
  return { starts, corners };
}

function wrongCount(): CorruptStreamError {
  return new CorruptStreamError("there are not as many corners at seams as announced");
}
