// Computes positions and normals of vertices from the positions of the file: a normal is that of the
// faces around a vertex, or around a normal row of a vertex at a hard edge.

import type { AttributeSetup } from "../backend.js";
import type { MeshSegment } from "../mesh_segment.js";

/** Limit of the scale of edges, a float32. */
const MAX_SCALE = 1e38;

/** The attributes "position" and "normal" of a mesh. */
export function meshAttributes(segment: MeshSegment): AttributeSetup {
  const { drawing, shift } = segment;
  const { info } = segment.reel;
  // Edges are scaled so that the products of very small or very large ones neither underflow nor
  // overflow.
  const scale = Math.min(1e4 / info.diagonal, MAX_SCALE).toExponential();
  return {
    nItems: info.nVerts,
    nVerts: drawing.sources.length,
    shift,
    attributes: [
      ["position", 3],
      ["normal", 3],
    ],
    table: createTopology(segment),
    glsl: `
out vec3 position;
out vec3 normal;
vec3 sideTo(uint vertex) {
  return (sumOf(vertex) - position) * ${scale};
}
void main() {
  uvec2 vertex = pairAt(gl_VertexID);
  uvec2 corners = pairAt(int(vertex.y));
  position = sumOf(vertex.x);
  vec3 sum = vec3(0.0);
  for (uint i = corners.x; i < corners.y; i++) {
    uvec2 corner = pairAt(int(i));
    sum += cross(sideTo(corner.x), sideTo(corner.y));
  }
  float size = length(sum);
  normal = size > 0.0 ? sum / size : vec3(0.0, 0.0, 1.0);
}`,
  };
}

/** Number of pairs of integers in the topology of a mesh. */
export function topologySize({ drawing }: MeshSegment): number {
  return drawing.sources.length + drawing.nRows + drawing.cornerRows.length;
}

/**
 * Return the connectivity as pairs of integers:
 *
 * - for each vertex of the drawing, the vertex of the file and the entry of its normal row,
 * - for each normal row, the entries of its first corner and behind its last one,
 * - for each corner of a row, the other two vertices of its triangle.
 */
function createTopology(segment: MeshSegment): Uint32Array {
  const { triangles } = segment.surface;
  const { sources, rows, nRows, cornerRows } = segment.drawing;
  const pairs = new Uint32Array(2 * topologySize(segment));
  const firstRow = sources.length;
  sources.forEach((source, i) => pairs.set([source, firstRow + rows[i]], 2 * i));
  const counts = new Uint32Array(nRows);
  for (const row of cornerRows) counts[row]++;
  let end = firstRow + nRows;
  counts.forEach((count, row) => {
    pairs.fill(end, 2 * (firstRow + row), 2 * (firstRow + row + 1));
    end += count;
  });
  cornerRows.forEach((row, i) => {
    const face = i - (i % 3);
    const corner = pairs[2 * (firstRow + row) + 1]++;
    pairs[2 * corner] = triangles[face + ((i + 1) % 3)];
    pairs[2 * corner + 1] = triangles[face + ((i + 2) % 3)];
  });
  return pairs;
}
