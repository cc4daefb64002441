// Smooth normals, computed for each vertex from the faces around it; on the GPU, since positions
// never leave it.

import * as THREE from "three";

import { Pass } from "./pass.js";
import { dataTexture, type VertexGrid } from "./vertex_grid.js";

/** Texels in a row of corners. */
const WIDTH = 2048;

// Scaled, so that the squares of very small and very large sides can be told from 0 and infinity.
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
  vec3 here = texelFetch(positions, texel, 0).xyz;
  uvec2 ring = texelFetch(rings, texel, 0).xy;
  vec3 sum = vec3(0.0);
  for (uint i = ring.x; i < ring.x + ring.y; i++) {
    ivec2 place = ivec2(int(i) & ${WIDTH - 1}, int(i) >> ${Math.log2(WIDTH)});
    uvec2 corner = texelFetch(corners, place, 0).xy;
    sum += cross(sideTo(corner.x, here), sideTo(corner.y, here));
  }
  float size = length(sum);
  normal = vec4(size > 0.0 ? sum / size : vec3(0.0, 0.0, 1.0), 0.0);
}`;

/** Rows of a texture of the corners of triangles. */
export function cornerRows(triangles: Uint32Array): number {
  return Math.ceil(triangles.length / WIDTH);
}

/**
 * A pass that computes normals from positions.
 *
 * @param diagonal - of the mesh, in model units
 */
export function normalPass(
  renderer: THREE.WebGLRenderer,
  grid: VertexGrid,
  positions: THREE.Texture,
  triangles: Uint32Array,
  diagonal: number,
): Pass {
  const { ring, corner } = ringsOf(triangles, grid);
  return new Pass(renderer, grid, normalShader(grid), {
    positions: { value: positions },
    rings: { value: dataTexture(ring, grid.width, 2) },
    corners: { value: dataTexture(corner, WIDTH, 2) },
    scale: { value: 1e4 / diagonal },
  });
}

/** For each vertex where its corners start and how many it has; a corner names the other two. */
function ringsOf(triangles: Uint32Array, grid: VertexGrid) {
  const ring = new Uint32Array(grid.nTexels * 2);
  for (const vertex of triangles) ring[2 * vertex + 1]++;
  for (let vertex = 1; vertex < grid.nVerts; vertex++) {
    ring[2 * vertex] = ring[2 * vertex - 2] + ring[2 * vertex - 1];
  }
  const corner = new Uint32Array(WIDTH * cornerRows(triangles) * 2);
  const next = Uint32Array.from({ length: grid.nVerts }, (_, vertex) => ring[2 * vertex]);
  for (let i = 0; i < triangles.length; i++) {
    const face = i - (i % 3);
    const at = 2 * next[triangles[i]]++;
    corner[at] = triangles[face + ((i + 1) % 3)];
    corner[at + 1] = triangles[face + ((i + 2) % 3)];
  }
  return { ring, corner };
}
