// Smooth normals, computed for each vertex from the faces around it; on the GPU, since positions
// never leave it.

import * as THREE from "three";

import { texture, type VertexGrid } from "./grid";
import { Pass } from "./pass";

const WIDTH = 2048;

const normalShader = (grid: VertexGrid) => `${grid.glsl}
uniform sampler2D positions;
uniform usampler2D rings;
uniform usampler2D corners;
out vec4 normal;
vec3 positionOf(uint vertex) { return texelFetch(positions, texelOf(int(vertex)), 0).xyz; }
void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec3 here = texelFetch(positions, texel, 0).xyz;
  uvec2 ring = texelFetch(rings, texel, 0).xy;
  vec3 sum = vec3(0.0);
  for (uint i = ring.x; i < ring.x + ring.y; i++) {
    uvec2 corner = texelFetch(corners, ivec2(int(i) & ${WIDTH - 1}, int(i) >> ${Math.log2(WIDTH)}), 0).xy;
    sum += cross(positionOf(corner.x) - here, positionOf(corner.y) - here);
  }
  float size = length(sum);
  normal = vec4(size > 0.0 ? sum / size : vec3(0.0, 0.0, 1.0), 0.0);
}`;

export class NormalPass {
  private readonly uniforms;
  private readonly pass: Pass;

  constructor(
    private readonly grid: VertexGrid,
    faces: Uint32Array,
  ) {
    this.uniforms = { positions: { value: null as THREE.Texture | null }, ...rings(grid, faces) };
    this.pass = new Pass(normalShader(grid), this.uniforms);
  }

  target(): THREE.WebGLRenderTarget {
    return this.grid.target(THREE.FloatType);
  }

  run(
    renderer: THREE.WebGLRenderer,
    positions: THREE.Texture,
    target: THREE.WebGLRenderTarget,
  ): void {
    this.uniforms.positions.value = positions;
    this.pass.run(renderer, target);
  }
}

/** For each vertex where its corners start and how many it has; a corner names the other two. */
function rings(grid: VertexGrid, faces: Uint32Array) {
  const ring = new Uint32Array(grid.nTexels * 2);
  for (const vertex of faces) ring[2 * vertex + 1]++;
  for (let vertex = 1; vertex < grid.nVerts; vertex++) {
    ring[2 * vertex] = ring[2 * vertex - 2] + ring[2 * vertex - 1];
  }
  const height = Math.max(1, Math.ceil(faces.length / WIDTH));
  const corner = new Uint32Array(WIDTH * height * 2);
  const next = Uint32Array.from({ length: grid.nVerts }, (_, vertex) => ring[2 * vertex]);
  for (let i = 0; i < faces.length; i++) {
    const face = i - (i % 3);
    const at = next[faces[i]]++;
    corner[2 * at] = faces[face + ((i + 1) % 3)];
    corner[2 * at + 1] = faces[face + ((i + 2) % 3)];
  }
  const make = (data: Uint32Array, width: number, rows: number) => ({
    value: texture(data, width, rows, THREE.RGIntegerFormat, THREE.UnsignedIntType),
  });
  return {
    rings: make(ring, grid.width, grid.height),
    corners: make(corner, WIDTH, height),
  };
}
