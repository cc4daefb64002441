// Computes normals on the GPU from the faces around each vertex, or around each normal row of a
// vertex at a hard edge.

import * as THREE from "three";

import { Pass } from "./pass.js";
import type { NormalRows } from "../normal_rows.js";
import { dataTexture, type VertexGrid } from "./vertex_grid.js";

/** Width of the texture of corners. */
const CORNERS_WIDTH = 2048;

// Edges are scaled so that the products of very small or very large ones neither underflow nor
// overflow.
const normalShader = (grid: VertexGrid) => `${grid.glsl}
uniform sampler2D positions;
uniform usampler2D rings;
uniform usampler2D corners;
uniform float scale;
out vec4 normal;
vec3 sideTo(uint vertex, vec3 here) {
  return (texelFetch(positions, texelOf(int(vertex)), 0).xyz - here) * scale;
}
void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy);
  uvec4 ring = texelFetch(rings, texel, 0);
  vec3 here = texelFetch(positions, texelOf(int(ring.z)), 0).xyz;
  vec3 sum = vec3(0.0);
  for (uint i = ring.x; i < ring.x + ring.y; i++) {
    ivec2 place = ivec2(int(i) & ${CORNERS_WIDTH - 1}, int(i) >> ${Math.log2(CORNERS_WIDTH)});
    uvec2 corner = texelFetch(corners, place, 0).xy;
    sum += cross(sideTo(corner.x, here), sideTo(corner.y, here));
  }
  float size = length(sum);
  normal = vec4(size > 0.0 ? sum / size : vec3(0.0, 0.0, 1.0), 0.0);
}`;

/** Height of the texture of corners. */
export function cornerTextureHeight(triangles: Uint32Array): number {
  return Math.ceil(triangles.length / CORNERS_WIDTH);
}

/**
 * Create a pass that computes normals from positions.
 *
 * @param grid - grid of the vertices
 * @param rowGrid - grid of the normal rows, the texels of the target: vertices without hard edges
 * @param shading - normal rows of a mesh with hard edges
 * @param diagonal - diagonal of the mesh, in model units
 */
export function normalPass(
  renderer: THREE.WebGLRenderer,
  [grid, rowGrid]: readonly [VertexGrid, VertexGrid],
  positions: THREE.Texture,
  triangles: Uint32Array,
  shading: NormalRows | null,
  diagonal: number,
): Pass {
  const { ring, corner } = buildRings(triangles, rowGrid, shading);
  return new Pass(renderer, rowGrid, normalShader(grid), {
    positions: { value: positions },
    rings: { value: dataTexture(ring, rowGrid.width, 4) },
    corners: { value: dataTexture(corner, CORNERS_WIDTH, 2) },
    scale: { value: 1e4 / diagonal },
  });
}

/**
 * Build the texels of rows (first corner, number of corners, vertex) and of corners (the other two
 * vertices of the triangle).
 */
function buildRings(triangles: Uint32Array, grid: VertexGrid, shading: NormalRows | null) {
  const rows = shading?.triangles ?? triangles;
  const ring = new Uint32Array(grid.nTexels * 4);
  for (const row of rows) ring[4 * row + 1]++;
  for (let row = 0; row < grid.nVerts; row++) {
    if (row) ring[4 * row] = ring[4 * row - 4] + ring[4 * row - 3];
    ring[4 * row + 2] = shading?.vertices[row] ?? row;
  }
  const corner = new Uint32Array(CORNERS_WIDTH * cornerTextureHeight(triangles) * 2);
  const next = Uint32Array.from({ length: grid.nVerts }, (_, row) => ring[4 * row]);
  for (let i = 0; i < triangles.length; i++) {
    const face = i - (i % 3);
    const at = 2 * next[rows[i]]++;
    corner[at] = triangles[face + ((i + 1) % 3)];
    corner[at + 1] = triangles[face + ((i + 2) % 3)];
  }
  return { ring, corner };
}
