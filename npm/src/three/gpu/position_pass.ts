// Computes positions on the GPU, one texel per vertex: the sum over the modes of field times weight,
// plus a correction.

import * as THREE from "three";

import type { BlockFields } from "../../types.js";
import type { CorrectedPoints, TextureUniform } from "../corrections.js";
import type { LoadedBlock, Picture, WeightedBlock } from "../loaded_block.js";
import { dataTexture, PRECISION, type VertexGrid } from "./vertex_grid.js";

/** Fields of four modes share a texel. */
export const MODES_PER_TEXEL = 4;

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

// A triangle that covers the target. Points that are drawn over it have other corrections.
const FULL_SCREEN_TRIANGLE = `
flat out vec3 correction;
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
  correction = vec3(0.0);
}`;

const CAMERA = new THREE.Camera();

type PassObject = THREE.Object3D & {
  readonly geometry: THREE.BufferGeometry;
  readonly material: THREE.RawShaderMaterial;
};

/** Computes the positions of pictures. */
export class PositionPass {
  readonly #renderer: THREE.WebGLRenderer;
  readonly #grid: VertexGrid;
  /** Computed positions, four numbers per texel of the grid. */
  readonly target: THREE.WebGLRenderTarget;
  readonly #fields = new Map<LoadedBlock, THREE.DataArrayTexture>();
  readonly #uniforms = {
    fields: { value: null as THREE.DataArrayTexture | null },
    nextFields: { value: null as THREE.DataArrayTexture | null },
    weights: { value: null as THREE.DataTexture | null },
    nGroups: { value: 0 },
    nNextGroups: { value: 0 },
    shift: { value: new THREE.Vector3() },
  };
  readonly #scene = new THREE.Scene();
  readonly #objects: PassObject[] = [];
  /** Null until a picture has corrections. */
  #corrected: CorrectedPoints | null = null;

  /** @param shift - added to all positions, in model units */
  constructor(
    renderer: THREE.WebGLRenderer,
    grid: VertexGrid,
    shift: readonly [number, number, number],
  ) {
    this.#renderer = renderer;
    this.#grid = grid;
    this.#uniforms.shift.value.set(...shift);
    this.target = grid.target();
    const triangle = new THREE.BufferGeometry();
    triangle.setDrawRange(0, 3);
    this.#add(new THREE.Mesh(triangle, this.#createMaterial(FULL_SCREEN_TRIANGLE)));
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

  /** Compute the positions of a picture; must not be called while the renderer is drawing. */
  run({ blocks: shares, corrections }: Picture): void {
    const [fields, nextFields = fields] = shares.map(({ block }) => this.#fields.get(block) ?? null);
    this.#uniforms.fields.value = fields;
    this.#uniforms.nextFields.value = nextFields;
    this.#setWeights(shares);
    this.#setCorrections(corrections);
    const renderer = this.#renderer;
    const before = renderer.getRenderTarget();
    const face = renderer.getActiveCubeFace();
    const level = renderer.getActiveMipmapLevel();
    const { xr } = renderer;
    const isXrEnabled = xr.enabled;
    xr.enabled = false;
    renderer.setRenderTarget(this.target);
    renderer.render(this.#scene, CAMERA);
    renderer.setRenderTarget(before, face, level);
    xr.enabled = isXrEnabled;
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
    this.#corrected?.dispose();
    this.#uniforms.weights.value?.dispose();
    this.target.dispose();
    for (const { geometry, material } of this.#objects) {
      geometry.dispose();
      material.dispose();
    }
  }

  /** Add an object that is drawn over the computed texels. */
  #add(object: PassObject): void {
    object.frustumCulled = false;
    object.renderOrder = this.#objects.push(object);
    this.#scene.add(object);
  }

  /** Create a material; the target has no depth buffer, and blending is off. */
  #createMaterial(
    vertexShader: string,
    uniforms: Record<string, THREE.IUniform> = {},
  ): THREE.RawShaderMaterial {
    return new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: PRECISION + vertexShader,
      fragmentShader: PRECISION + POSITION_SHADER,
      uniforms: { ...this.#uniforms, ...uniforms },
    });
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
    setTextureData(this.#uniforms.weights, data, 3);
    this.#uniforms.nGroups.value = nGroups;
    this.#uniforms.nNextGroups.value = nNextGroups;
  }

  #setCorrections(corrections: Picture["corrections"]): void {
    if (corrections && !this.#corrected) {
      this.#corrected = corrections.createPoints(
        this.#grid,
        (vertexShader, uniforms) => this.#createMaterial(vertexShader, uniforms),
        setTextureData,
      );
      this.#add(this.#corrected.object);
    }
    this.#corrected?.set(corrections?.offsets);
  }
}

/** Set the data of a texture, replacing it if the size differs. */
function setTextureData(
  uniform: TextureUniform,
  data: Float32Array<ArrayBuffer> | Uint32Array<ArrayBuffer>,
  width: number,
): void {
  const texture = uniform.value;
  if (texture?.image.data?.length === data.length) {
    texture.image.data = data;
    texture.needsUpdate = true;
  } else {
    texture?.dispose();
    uniform.value = dataTexture(data, width);
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
