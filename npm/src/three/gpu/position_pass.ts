// Computes positions on the GPU: per vertex, the sum over the modes of field times weight, plus a
// correction.

import * as THREE from "three";

import type { BlockFields } from "../../types.js";
import type { LoadedBlock, Picture, WeightedBlock } from "../loaded_block.js";
import { Pass, passMaterial } from "./pass.js";
import { dataTexture, type VertexGrid } from "./vertex_grid.js";

/** Fields of four modes share a texel. */
export const MODES_PER_TEXEL = 4;

/** Width of the texture of corrections. */
const CORRECTIONS_WIDTH = 1024;

// A picture between the last frame of a block and the first frame of the next uses both blocks.
const POSITION_SHADER = `
uniform isampler2DArray fields;
uniform isampler2DArray nextFields;
uniform sampler2D weights;
uniform int nGroups;
uniform int nNextGroups;
uniform vec3 shift;
flat in vec3 correction;
out vec4 position;
vec3 product(ivec4 field, int group) {
  return vec4(field) * mat3x4(
    texelFetch(weights, ivec2(0, group), 0),
    texelFetch(weights, ivec2(1, group), 0),
    texelFetch(weights, ivec2(2, group), 0));
}
void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec3 sum = correction;
  for (int i = 0; i < nGroups; i++) sum += product(texelFetch(fields, ivec3(texel, i), 0), i);
  for (int i = 0; i < nNextGroups; i++) {
    sum += product(texelFetch(nextFields, ivec3(texel, i), 0), nGroups + i);
  }
  position = vec4(sum + shift, 1.0);
}`;

// Corrected vertices are drawn again, as points over their texels, since not every GPU can blend
// floats. A texel of corrections has the vertex and the bits of three floats.
const correctedVertex = (grid: VertexGrid) => `${grid.glsl}
uniform usampler2D corrections;
flat out vec3 correction;
void main() {
  ivec2 place = ivec2(gl_VertexID & ${CORRECTIONS_WIDTH - 1}, gl_VertexID >> ${Math.log2(CORRECTIONS_WIDTH)});
  uvec4 found = texelFetch(corrections, place, 0);
  vec2 texel = vec2(texelOf(int(found.x))) + 0.5;
  gl_Position = vec4(texel / vec2(${grid.width}, ${grid.height}) * 2.0 - 1.0, 0.0, 1.0);
  gl_PointSize = 1.0;
  correction = uintBitsToFloat(found.yzw);
}`;

/** Computes the positions of pictures. */
export class PositionPass {
  readonly #renderer: THREE.WebGLRenderer;
  readonly #grid: VertexGrid;
  readonly #fields = new Map<LoadedBlock, THREE.DataArrayTexture>();
  readonly #uniforms = {
    fields: { value: null as THREE.DataArrayTexture | null },
    nextFields: { value: null as THREE.DataArrayTexture | null },
    weights: { value: dataTexture(new Float32Array(12), 3) },
    corrections: { value: dataTexture(new Uint32Array(4 * CORRECTIONS_WIDTH), CORRECTIONS_WIDTH) },
    nGroups: { value: 0 },
    nNextGroups: { value: 0 },
    shift: { value: new THREE.Vector3() },
  };
  readonly #pass: Pass;
  readonly #corrected: THREE.Points<THREE.BufferGeometry, THREE.RawShaderMaterial>;

  /** @param shift - added to all positions, in model units */
  constructor(
    renderer: THREE.WebGLRenderer,
    grid: VertexGrid,
    shift: readonly [number, number, number],
  ) {
    this.#renderer = renderer;
    this.#grid = grid;
    this.#uniforms.shift.value.set(...shift);
    const material = passMaterial(correctedVertex(grid), POSITION_SHADER, this.#uniforms);
    this.#corrected = new THREE.Points(new THREE.BufferGeometry(), material);
    this.#pass = new Pass(renderer, grid, POSITION_SHADER, this.#uniforms);
    this.#pass.add(this.#corrected);
  }

  /** Computed positions, four numbers per texel of the grid. */
  get target(): THREE.WebGLRenderTarget {
    return this.#pass.target;
  }

  /** Upload the fields of a block to the GPU and release the copy in memory. */
  upload(block: BlockFields, loaded: LoadedBlock): void {
    const texture = fieldTexture(block, this.#grid);
    texture.onUpdate = () => {
      texture.image.data = null;
    };
    this.#renderer.initTexture(texture);
    this.#fields.set(loaded, texture);
  }

  release(block: LoadedBlock): void {
    this.#fields.get(block)?.dispose();
    this.#fields.delete(block);
  }

  run({ blocks: shares, corrections }: Picture): void {
    const [fields, nextFields = fields] = shares.map(({ block }) => this.#fields.get(block) ?? null);
    this.#uniforms.fields.value = fields;
    this.#uniforms.nextFields.value = nextFields;
    this.#setWeights(shares);
    this.#setCorrections(corrections);
    this.#pass.run();
  }

  /** Read the positions of vertices back, three numbers per vertex. */
  read(vertices: Uint32Array, into: Float32Array): void {
    const { width, height, nTexels } = this.#grid;
    const texels = new Float32Array(nTexels * 4);
    this.#renderer.readRenderTargetPixels(this.target, 0, 0, width, height, texels);
    for (let i = 0; i < into.length; i++) {
      into[i] = texels[4 * vertices[Math.floor(i / 3)] + (i % 3)];
    }
  }

  dispose(): void {
    for (const block of this.#fields.keys()) this.release(block);
    this.#pass.dispose();
  }

  #setWeights(shares: readonly WeightedBlock[]): void {
    const [nGroups, nNextGroups = 0] = shares.map(({ block }) => layersFor(block.nModes));
    const data = new Float32Array(12 * (nGroups + nNextGroups));
    let row = 0;
    for (const { block, weights } of shares) {
      weights.forEach((weight, i) => {
        const mode = Math.floor(i / 3);
        data[12 * (row + (mode >> 2)) + 4 * (i % 3) + (mode & 3)] = weight;
      });
      row += layersFor(block.nModes);
    }
    setTextureData(this.#uniforms.weights, data);
    this.#uniforms.nGroups.value = nGroups;
    this.#uniforms.nNextGroups.value = nNextGroups;
  }

  #setCorrections(corrections: Picture["corrections"]): void {
    const { size } = corrections;
    this.#corrected.visible = size > 0;
    if (size === 0) return;
    this.#corrected.geometry.setDrawRange(0, size);
    const data = new Uint32Array(4 * CORRECTIONS_WIDTH * Math.ceil(size / CORRECTIONS_WIDTH));
    const floats = new Float32Array(data.buffer);
    let at = 0;
    for (const [vertex, offset] of corrections) {
      data[at] = vertex;
      floats.set(offset, at + 1);
      at += 4;
    }
    setTextureData(this.#uniforms.corrections, data);
  }
}

/** Set the data of a texture, replacing it if the size differs. */
function setTextureData(
  uniform: { value: THREE.DataTexture },
  data: Float32Array<ArrayBuffer> | Uint32Array<ArrayBuffer>,
): void {
  const { image } = uniform.value;
  if (image.data?.length === data.length) {
    image.data = data;
    uniform.value.needsUpdate = true;
  } else {
    uniform.value.dispose();
    uniform.value = dataTexture(data, image.width);
  }
}

function layersFor(nModes: number): number {
  return Math.ceil(nModes / MODES_PER_TEXEL);
}

function fieldTexture(block: BlockFields, grid: VertexGrid): THREE.DataArrayTexture {
  const { fields, nModes, nVerts } = block;
  const nGroups = layersFor(nModes);
  const packed = new Int16Array(nGroups * grid.nTexels * 4);
  for (let mode = 0; mode < nModes; mode++) {
    let to = (mode >> 2) * grid.nTexels * 4 + (mode & 3);
    for (let from = mode * nVerts; from < (mode + 1) * nVerts; from++, to += 4) {
      packed[to] = fields[from];
    }
  }
  const texture = new THREE.DataArrayTexture(packed, grid.width, grid.height, nGroups);
  texture.format = THREE.RGBAIntegerFormat;
  texture.type = THREE.ShortType;
  texture.internalFormat = "RGBA16I";
  texture.needsUpdate = true;
  return texture;
}
