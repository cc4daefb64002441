// Positions of a picture, computed once for each vertex into a texture: the sum over the modes of
// field times weight, plus corrections.

import * as THREE from "three";

import type { BlockFields } from "../../types";
import {
  type Corrections,
  correctionsOf,
  type HeldBlock,
  type Moment,
  type Share,
  sharesOf,
} from "../held_block";
import { Pass, passMaterial } from "./pass";
import { dataTexture, type VertexGrid } from "./vertex_grid";

/** Modes of a texel of fields, which has four numbers. */
export const MODES_A_TEXEL = 4;

// A picture may lie between the last frame of a block and the first of another.
const SUM = `
uniform isampler2DArray fields;
uniform isampler2DArray nextFields;
uniform sampler2D weights;
uniform int nGroups;
uniform int nNextGroups;
uniform vec3 shift;
vec3 product(ivec4 field, int group) {
  vec4 f = vec4(field);
  return vec3(
    dot(f, texelFetch(weights, ivec2(0, group), 0)),
    dot(f, texelFetch(weights, ivec2(1, group), 0)),
    dot(f, texelFetch(weights, ivec2(2, group), 0)));
}
vec3 sumOfModes(ivec2 texel) {
  vec3 sum = vec3(0.0);
  for (int i = 0; i < nGroups; i++) sum += product(texelFetch(fields, ivec3(texel, i), 0), i);
  for (int i = 0; i < nNextGroups; i++) {
    sum += product(texelFetch(nextFields, ivec3(texel, i), 0), nGroups + i);
  }
  return sum;
}`;

const POSITION = `${SUM}
out vec4 position;
void main() {
  position = vec4(sumOfModes(ivec2(gl_FragCoord.xy)) + shift, 1.0);
}`;

// Corrected vertices are computed again, as points over their texels: no blending of floats, which
// not every GPU can do.
const correctedVertex = (grid: VertexGrid) => `${grid.glsl}
in uint vertex;
in vec3 offset;
flat out vec3 correction;
void main() {
  vec2 texel = vec2(texelOf(int(vertex))) + 0.5;
  gl_Position = vec4(texel / vec2(${grid.width}, ${grid.height}) * 2.0 - 1.0, 0.0, 1.0);
  gl_PointSize = 1.0;
  correction = offset;
}`;

const CORRECTED = `${SUM}
flat in vec3 correction;
out vec4 position;
void main() {
  position = vec4(sumOfModes(ivec2(gl_FragCoord.xy)) + correction + shift, 1.0);
}`;

/** Computes positions of pictures. */
export class PositionPass {
  readonly target: THREE.WebGLRenderTarget;
  private readonly fields = new Map<HeldBlock, THREE.DataArrayTexture>();
  private readonly uniforms = {
    fields: { value: null as THREE.DataArrayTexture | null },
    nextFields: { value: null as THREE.DataArrayTexture | null },
    weights: { value: null as THREE.DataTexture | null },
    nGroups: { value: 0 },
    nNextGroups: { value: 0 },
    shift: { value: new THREE.Vector3() },
  };
  private readonly pass = new Pass(POSITION, this.uniforms);
  private readonly corrected: THREE.Points<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  private capacity = 0;

  /** @param shift - is added to all positions, in model units */
  constructor(
    private readonly renderer: THREE.WebGLRenderer,
    private readonly grid: VertexGrid,
    shift: readonly [number, number, number],
  ) {
    this.target = grid.target();
    this.uniforms.shift.value.set(...shift);
    const material = passMaterial(correctedVertex(grid), CORRECTED, this.uniforms);
    this.corrected = new THREE.Points(new THREE.BufferGeometry(), material);
    this.pass.add(this.corrected);
  }

  /** Sends the fields of a block to the GPU; they are not kept elsewhere. */
  hold(block: BlockFields, held: HeldBlock): void {
    const texture = fieldTexture(block, this.grid);
    texture.onUpdate = () => {
      texture.image.data = null;
    };
    this.renderer.initTexture(texture);
    this.fields.set(held, texture);
  }

  release(block: HeldBlock): void {
    this.fields.get(block)?.dispose();
    this.fields.delete(block);
  }

  run(moment: Moment): void {
    const { uniforms } = this;
    uniforms.fields.value = this.fields.get(moment.block) ?? null;
    uniforms.nextFields.value = this.fields.get(moment.next) ?? null;
    this.setWeights(sharesOf(moment));
    this.setCorrections(correctionsOf(moment));
    this.pass.run(this.renderer, this.target);
  }

  /** Positions of the picture, read back: three numbers for each vertex. */
  read(into: Float32Array): void {
    const { width, height, nTexels } = this.grid;
    const texels = new Float32Array(nTexels * 4);
    this.renderer.readRenderTargetPixels(this.target, 0, 0, width, height, texels);
    for (let i = 0; i < into.length; i++) into[i] = texels[4 * Math.floor(i / 3) + (i % 3)];
  }

  dispose(): void {
    for (const block of this.fields.keys()) this.release(block);
    this.uniforms.weights.value?.dispose();
    this.target.dispose();
    this.pass.dispose();
  }

  private setWeights(shares: readonly Share[]): void {
    const [nGroups, nNextGroups = 0] = shares.map(({ block }) => groupsOf(block.nModes));
    const height = nGroups + nNextGroups;
    let held = this.uniforms.weights.value;
    if (!held || held.image.height < height) {
      held?.dispose();
      held = dataTexture(new Float32Array(12 * height), 3, height, THREE.RGBAFormat);
      this.uniforms.weights.value = held;
    }
    const data = held.image.data as Float32Array;
    data.fill(0);
    let row = 0;
    for (const { block, weights } of shares) {
      weights.forEach((weight, i) => {
        const mode = Math.floor(i / 3);
        data[12 * (row + (mode >> 2)) + 4 * (i % 3) + (mode & 3)] = weight;
      });
      row += groupsOf(block.nModes);
    }
    held.needsUpdate = true;
    this.uniforms.nGroups.value = nGroups;
    this.uniforms.nNextGroups.value = nNextGroups;
  }

  private setCorrections({ vertices, offsets }: Corrections): void {
    const count = vertices.length;
    this.corrected.visible = count > 0;
    if (count > this.capacity) this.grow(2 * count);
    const { geometry } = this.corrected;
    for (const [name, values] of [
      ["vertex", vertices],
      ["offset", offsets],
    ] as const) {
      const attribute = geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
      if (!attribute || count === 0) continue;
      attribute.array.set(values);
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, values.length);
      attribute.needsUpdate = true;
    }
    geometry.setDrawRange(0, count);
  }

  private grow(capacity: number): void {
    const { geometry } = this.corrected;
    geometry.dispose();
    const vertex = new THREE.BufferAttribute(new Uint32Array(capacity), 1);
    const offset = new THREE.BufferAttribute(new Float32Array(3 * capacity), 3);
    geometry.setAttribute("vertex", vertex.setUsage(THREE.DynamicDrawUsage));
    geometry.setAttribute("offset", offset.setUsage(THREE.DynamicDrawUsage));
    this.capacity = capacity;
  }
}

function groupsOf(nModes: number): number {
  return Math.max(1, Math.ceil(nModes / MODES_A_TEXEL));
}

function fieldTexture(block: BlockFields, grid: VertexGrid): THREE.DataArrayTexture {
  const { fields, nModes, nVerts } = block;
  const nGroups = groupsOf(nModes);
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
