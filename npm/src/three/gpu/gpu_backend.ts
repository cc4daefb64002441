// Computes attributes on the GPU with WebGL 2: a render pass computes positions, or other sums over the
// modes of field times weight plus a correction, one texel per vertex or item. A second pass computes
// attributes from them.

import * as THREE from "three";

import type { BlockFields } from "../../types.js";
import type { AttributeSetup, Backend } from "../backend.js";
import type { LoadedBlock, Picture, WeightedBlock } from "../loaded_block.js";
import type { MeshSegment } from "../mesh_segment.js";
import { AttributePass } from "./attribute_pass.js";
import { CorrectedPoints } from "./corrected_points.js";
import { meshAttributes, topologySize } from "./normals.js";
import { PRELUDE, setTable, type TableUniform, tableSize } from "./tables.js";

/** A renderer of three.js: `WebGLRenderer` or any other. */
export interface Renderer {
  readonly domElement: EventTarget;
}

/** Fields of four modes share a texel. */
const MODES_PER_TEXEL = 4;

// A picture between the last frame of a block and the first frame of the next uses both blocks.
const FRAGMENT_SHADER = `${PRELUDE}
uniform isampler2DArray fields;
uniform isampler2DArray nextFields;
uniform sampler2D weights;
uniform int nNextGroups;
flat in vec3 start;
out vec4 position;
vec4 weightsAt(int entry) {
  return texelFetch(weights, texelOf(entry), 0);
}
vec3 product(ivec4 field, int group) {
  int entry = 3 * group;
  return vec4(field) * mat3x4(weightsAt(entry), weightsAt(entry + 1), weightsAt(entry + 2));
}
void main() {
  ivec2 texel = ivec2(gl_FragCoord.xy);
  int nGroups = textureSize(fields, 0).z;
  vec3 sum = start;
  for (int i = 0; i < nGroups; i++) sum += product(texelFetch(fields, ivec3(texel, i), 0), i);
  for (int i = 0; i < nNextGroups; i++) {
    sum += product(texelFetch(nextFields, ivec3(texel, i), 0), nGroups + i);
  }
  position = vec4(sum, 1.0);
}`;

// A triangle that covers the target. Points that are drawn over it have corrections.
const TRIANGLE_SHADER = `${PRELUDE}
uniform vec3 shift;
flat out vec3 start;
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
  start = shift;
}`;

const CAMERA = new THREE.Camera();

/**
 * Create the backend of a segment.
 *
 * @throws Error if the renderer does not use WebGL 2, the GPU cannot render to float textures, the
 *   mesh is too large, or the driver rejects a program.
 */
export function createGpuBackend(renderer: Renderer, segment: MeshSegment): GpuBackend {
  if (isWebGL(renderer) && renderer.extensions.has("EXT_color_buffer_float")) {
    const { height } = tableSize(topologySize(segment));
    if (height <= renderer.capabilities.maxTextureSize) {
      return new GpuBackend(renderer, segment.geometry, meshAttributes(segment));
    }
  }
  throw new Error("the GPU does not support the mesh");
}

function isWebGL(renderer: Renderer): renderer is THREE.WebGLRenderer {
  return "isWebGLRenderer" in renderer;
}

/** Computes attributes of a geometry. */
export class GpuBackend implements Backend {
  readonly isOnGpu = true;
  readonly #renderer: THREE.WebGLRenderer;
  readonly #geometry: THREE.BufferGeometry;
  readonly #attributes: AttributePass;
  /** Computed sums, four numbers per item. */
  readonly #target: THREE.WebGLRenderTarget;
  readonly #fields = new Map<LoadedBlock, THREE.DataArrayTexture>();
  readonly #uniforms = {
    fields: { value: null as THREE.DataArrayTexture | null },
    nextFields: { value: null as THREE.DataArrayTexture | null },
    weights: { value: null } as TableUniform,
    nNextGroups: { value: 0 },
    /** Added to all sums. */
    shift: { value: new THREE.Vector3() },
  };
  /** A triangle that covers the target. */
  readonly #triangle: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  /** Null until a picture has corrections. */
  #corrected: CorrectedPoints | null = null;

  constructor(renderer: THREE.WebGLRenderer, geometry: THREE.BufferGeometry, setup: AttributeSetup) {
    this.#renderer = renderer;
    this.#geometry = geometry;
    this.#attributes = new AttributePass(renderer, geometry, setup);
    const { width, height } = tableSize(setup.nItems);
    this.#target = new THREE.WebGLRenderTarget(width, height, {
      type: THREE.FloatType,
      depthBuffer: false,
      minFilter: THREE.NearestFilter,
      magFilter: THREE.NearestFilter,
    });
    this.#uniforms.shift.value.fromArray(setup.shift);
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: TRIANGLE_SHADER,
      fragmentShader: FRAGMENT_SHADER,
      uniforms: this.#uniforms,
    });
    this.#triangle = new THREE.Mesh(new THREE.BufferGeometry(), material);
    this.#triangle.geometry.setDrawRange(0, 3);
    this.#triangle.frustumCulled = false;
  }

  /** Upload the fields of a block to the GPU and release the copy in memory. */
  upload(block: BlockFields, loaded: LoadedBlock): void {
    const gl = this.#renderer.getContext() as WebGL2RenderingContext;
    const nGroups = groupCount(block.nModes);
    if (nGroups > gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS)) {
      throw new Error(`the GPU does not support ${block.nModes} modes`);
    }
    const texture = fieldTexture(block, this.#target);
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

  /** Compute a picture; must not be called while the renderer is drawing. */
  show({ blocks, corrections }: Picture): void {
    const { fields, nextFields, nNextGroups, weights } = this.#uniforms;
    const [first, next = null] = blocks.map(({ block }) => this.#fields.get(block) ?? null);
    fields.value = first;
    nextFields.value = next ?? first;
    nNextGroups.value = next?.image.depth ?? 0;
    setTable(weights, packWeights(blocks));
    if (corrections.size) this.#corrected ??= new CorrectedPoints(this.#triangle);
    this.#corrected?.set(corrections);
    const renderer = this.#renderer;
    const before = renderer.getRenderTarget();
    const face = renderer.getActiveCubeFace();
    const level = renderer.getActiveMipmapLevel();
    const { xr } = renderer;
    const isXrEnabled = xr.enabled;
    xr.enabled = false;
    renderer.setRenderTarget(this.#target);
    renderer.render(this.#triangle, CAMERA);
    renderer.setRenderTarget(before, face, level);
    xr.enabled = isXrEnabled;
    this.#attributes.run(this.#target.texture);
  }

  read(vertices: Uint32Array, into: Float32Array): void {
    const { width, height } = this.#target;
    const texels = new Float32Array(4 * width * height);
    this.#renderer.readRenderTargetPixels(this.#target, 0, 0, width, height, texels);
    for (let i = 0; i < into.length; i++) {
      into[i] = texels[4 * vertices[Math.floor(i / 3)] + (i % 3)];
    }
  }

  createAttribute(setup: AttributeSetup): GpuBackend {
    return new GpuBackend(this.#renderer, this.#geometry, setup);
  }

  dispose(): void {
    for (const block of this.#fields.keys()) this.release(block);
    this.#corrected?.dispose();
    this.#uniforms.weights.value?.dispose();
    this.#target.dispose();
    this.#triangle.geometry.dispose();
    this.#triangle.material.dispose();
    this.#attributes.dispose();
  }
}

function groupCount(nModes: number): number {
  return Math.ceil(nModes / MODES_PER_TEXEL);
}

/** Pack the weights of blocks: three texels per group of modes, one per axis. */
function packWeights(blocks: readonly WeightedBlock[]): Float32Array {
  const nGroups = blocks.reduce((sum, { block }) => sum + groupCount(block.nModes), 0);
  const packed = new Float32Array(12 * nGroups);
  let start = 0;
  for (const { block, weights } of blocks) {
    weights.forEach((weight, i) => {
      const mode = Math.floor(i / 3);
      packed[start + 12 * (mode >> 2) + 4 * (i % 3) + (mode & 3)] = weight;
    });
    start += 12 * groupCount(block.nModes);
  }
  return packed;
}

function fieldTexture(block: BlockFields, { width, height }: THREE.WebGLRenderTarget): THREE.DataArrayTexture {
  const { fields, nModes, nVerts } = block;
  const nGroups = groupCount(nModes);
  const groupLength = 4 * width * height;
  const packed = new Int16Array(groupLength * nGroups);
  for (let mode = 0; mode < nModes; mode++) {
    let to = groupLength * (mode >> 2) + (mode & 3);
    for (let from = mode * nVerts; from < (mode + 1) * nVerts; from++, to += 4) {
      packed[to] = fields[from];
    }
  }
  const texture = new THREE.DataArrayTexture(packed, width, height, nGroups);
  texture.format = THREE.RGBAIntegerFormat;
  texture.type = THREE.ShortType;
  texture.internalFormat = "RGBA16I";
  texture.needsUpdate = true;
  return texture;
}
