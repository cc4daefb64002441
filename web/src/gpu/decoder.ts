// Positions of a frame, computed once for each vertex into a texture: the sum over the modes of
// field times weight. Everything that draws, shades or reads back takes them from there.

import * as THREE from "three";

import type { VertexGrid } from "./grid";
import type { Corrections, FrameWeights, ModeBlock } from "./mode_block";
import { Pass, passMaterial } from "./pass";

const SUM = `
uniform isampler2DArray fields;
uniform sampler2D weights;
uniform int nGroups;
vec3 sumOfModes(ivec2 texel) {
  vec3 sum = vec3(0.0);
  for (int group = 0; group < nGroups; group++) {
    vec4 field = vec4(texelFetch(fields, ivec3(texel, group), 0));
    sum.x += dot(field, texelFetch(weights, ivec2(0, group), 0));
    sum.y += dot(field, texelFetch(weights, ivec2(1, group), 0));
    sum.z += dot(field, texelFetch(weights, ivec2(2, group), 0));
  }
  return sum;
}`;

const POSITION = `${SUM}
out vec4 position;
void main() {
  position = vec4(sumOfModes(ivec2(gl_FragCoord.xy)), 1.0);
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
  position = vec4(sumOfModes(ivec2(gl_FragCoord.xy)) + correction, 1.0);
}`;

export class Decoder {
  readonly target: THREE.WebGLRenderTarget;
  private readonly uniforms = {
    fields: { value: null as THREE.DataArrayTexture | null },
    weights: { value: null as THREE.DataTexture | null },
    nGroups: { value: 0 },
  };
  private readonly pass = new Pass(POSITION, this.uniforms);
  private readonly corrected: THREE.Points<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  private capacity = 0;
  private key = "";
  private block: ModeBlock | null = null;

  constructor(
    private readonly renderer: THREE.WebGLRenderer,
    private readonly grid: VertexGrid,
  ) {
    this.target = grid.target(THREE.FloatType);
    const material = passMaterial(correctedVertex(grid), CORRECTED, this.uniforms);
    this.corrected = new THREE.Points(new THREE.BufferGeometry(), material);
    this.pass.add(this.corrected);
  }

  /** Sends a block to the GPU before it is needed, so that playback does not stop for it. */
  prepare(block: ModeBlock): void {
    const layers = this.renderer.getContext().getParameter(0x88ff /* MAX_ARRAY_TEXTURE_LAYERS */);
    if (block.nModes > 4 * layers) {
      throw new Error(`A block has ${block.nModes} modes; this graphics card takes ${4 * layers}.`);
    }
    this.renderer.initTexture(block.fields);
  }

  /**
   * Computes the positions between frame `t` of a block and the next one, from its first modes;
   * false where they are there already.
   */
  decode(block: ModeBlock, t: number, fraction: number, nModes: number): boolean {
    const key = `${t} ${fraction} ${nModes}`;
    if (block === this.block && key === this.key) return false;
    [this.block, this.key] = [block, key];
    this.uniforms.fields.value = block.fields;
    this.setWeights(block.weightsAt(t, fraction, nModes));
    const isComplete = nModes >= block.nModes;
    this.setCorrections(block, isComplete ? block.correctionsAt(t, fraction) : null);
    this.pass.run(this.renderer, this.target);
    return true;
  }

  /** Positions (V, 3) relative to the origin, read back from the GPU. */
  read(): Float32Array {
    const { width, height, nVerts } = this.grid;
    const texels = new Float32Array(width * height * 4);
    this.renderer.readRenderTargetPixels(this.target, 0, 0, width, height, texels);
    return new Float32Array(3 * nVerts).map((_, i) => texels[4 * Math.floor(i / 3) + (i % 3)]);
  }

  /** Waits until the GPU has done its work. */
  wait(): void {
    this.renderer.readRenderTargetPixels(this.target, 0, 0, 1, 1, new Float32Array(4));
  }

  private setWeights({ weights, nGroups }: FrameWeights): void {
    let held = this.uniforms.weights.value;
    if (!held || held.image.height < nGroups) {
      held?.dispose();
      const data = new Float32Array(Math.max(1, nGroups) * 12);
      held = new THREE.DataTexture(
        data,
        3,
        Math.max(1, nGroups),
        THREE.RGBAFormat,
        THREE.FloatType,
      );
      this.uniforms.weights.value = held;
    }
    (held.image.data as unknown as Float32Array).set(weights);
    held.needsUpdate = true;
    this.uniforms.nGroups.value = nGroups;
  }

  private setCorrections(block: ModeBlock, corrections: Corrections | null): void {
    const count = corrections?.vertices.length ?? 0;
    this.corrected.visible = count > 0;
    if (!corrections || count === 0) return;
    if (count > this.capacity) this.grow(Math.max(count, block.mostCorrections));
    const { vertex, offset } = this.corrected.geometry.attributes;
    for (const [attribute, values] of [
      [vertex, corrections.vertices],
      [offset, corrections.offsets],
    ] as [THREE.BufferAttribute, THREE.TypedArray][]) {
      attribute.array.set(values);
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, values.length);
      attribute.needsUpdate = true;
    }
    this.corrected.geometry.setDrawRange(0, count);
  }

  private grow(capacity: number): void {
    const geometry = new THREE.BufferGeometry();
    const vertex = new THREE.BufferAttribute(new Uint32Array(capacity), 1);
    const offset = new THREE.BufferAttribute(new Float32Array(3 * capacity), 3);
    geometry.setAttribute("vertex", vertex.setUsage(THREE.DynamicDrawUsage));
    geometry.setAttribute("offset", offset.setUsage(THREE.DynamicDrawUsage));
    this.corrected.geometry.dispose();
    this.corrected.geometry = geometry;
    this.capacity = capacity;
  }
}
