// Computes positions and normals of vertices from the positions of the file: a normal is that of the
// faces around a vertex, or around a normal row of a vertex at a hard edge.

import type * as THREE from "three";

import type { MeshSetup } from "../backend.js";
import type { AttributeShader } from "./attribute_pass.js";
import { dataTexture, type VertexGrid } from "./vertex_grid.js";

/** Width of the texture of corners. */
const CORNERS_WIDTH = 2048;

/** Limit of the scale of edges, a float32. */
const MAX_SCALE = 1e38;

/**
 * Create the shader of the attributes "position" and "normal".
 *
 * @param grid - grid of the vertices of the file
 * @param diagonal - diagonal of the mesh, in model units
 */
export function normalShader(grid: VertexGrid, diagonal: number): AttributeShader {
  // Edges are scaled so that the products of very small or very large ones neither underflow nor
  // overflow.
  const scale = Math.min(1e4 / diagonal, MAX_SCALE).toExponential();
  return {
    textures: ["positions", "corners"],
    inputs: ["source", "first", "count"],
    attributes: [
      ["position", 3],
      ["normal", 3],
    ],
    glsl: `${grid.glsl}
uniform sampler2D positions;
uniform usampler2D corners;
vec3 positionOf(uint vertex) {
  return texelFetch(positions, texelOf(int(vertex)), 0).xyz;
}
vec3 sideTo(uint vertex) {
  return (positionOf(vertex) - position) * ${scale};
}
void main() {
  position = positionOf(source);
  vec3 sum = vec3(0.0);
  for (uint i = first; i < first + count; i++) {
    ivec2 place = ivec2(int(i) & ${CORNERS_WIDTH - 1}, int(i) >> ${Math.log2(CORNERS_WIDTH)});
    uvec2 corner = texelFetch(corners, place, 0).xy;
    sum += cross(sideTo(corner.x), sideTo(corner.y));
  }
  float size = length(sum);
  normal = size > 0.0 ? sum / size : vec3(0.0, 0.0, 1.0);
}`,
  };
}

/** Height of the texture of corners. */
export function cornerTextureHeight(triangles: Uint32Array): number {
  return Math.ceil(triangles.length / CORNERS_WIDTH);
}

/**
 * Create the texture of corners, and the inputs of the shader: the corners of a vertex are those from
 * `first`. Each corner consists of the other two vertices of its triangle.
 */
export function createCorners({ info, triangles, drawing }: MeshSetup): {
  corners: THREE.DataTexture;
  inputs: Uint32Array[];
} {
  const { sources, rows, shading } = drawing;
  const rowOf = shading?.triangles ?? triangles;
  const counts = new Uint32Array(shading?.vertices.length ?? info.nVerts);
  for (const row of rowOf) counts[row]++;
  let end = 0;
  const firsts = counts.map((count) => (end += count) - count);
  const next = firsts.slice();
  const corners = new Uint32Array(CORNERS_WIDTH * cornerTextureHeight(triangles) * 2);
  for (let i = 0; i < triangles.length; i++) {
    const face = i - (i % 3);
    const at = 2 * next[rowOf[i]]++;
    corners[at] = triangles[face + ((i + 1) % 3)];
    corners[at + 1] = triangles[face + ((i + 2) % 3)];
  }
  return {
    corners: dataTexture(corners, CORNERS_WIDTH, 2),
    inputs: [sources, ...[firsts, counts].map((ofRows) => rows.map((row) => ofRows[row]))],
  };
}
