// Corrections: offsets of single vertices, which few files have. Loaded with the first block that has
// some.

import * as THREE from "three";

import type { LoadedBlock, Moment } from "./loaded_block.js";

/** Corrections of a picture. */
export interface Corrections {
  /** Offsets of corrected vertices, three numbers each. */
  readonly offsets: ReadonlyMap<number, readonly number[]>;
  createPoints(...args: ConstructorParameters<typeof CorrectedPoints>): CorrectedPoints;
}

/** Blend the corrections of a moment. Blocks are not corrected if some of their modes are inactive. */
export function blendCorrections(moment: Moment): Corrections {
  const { block, t, next, nextT, fraction, nActiveModes } = moment;
  const offsets = new Map<number, number[]>();
  const add = (from: LoadedBlock, frame: number, factor: number) => {
    if (nActiveModes < from.nBlockModes) return;
    for (let i = from.correctionStarts[frame]; i < from.correctionStarts[frame + 1]; i++) {
      const vertex = from.correctionVertices[i];
      const sum = offsets.get(vertex) ?? [0, 0, 0];
      offsets.set(
        vertex,
        sum.map((one, axis) => one + factor * from.correctionOffsets[3 * i + axis]),
      );
    }
  };
  add(block, t, 1 - fraction);
  if (fraction > 0) add(next, nextT, fraction);
  return { offsets, createPoints: (...args) => new CorrectedPoints(...args) };
}

// An entry has the vertex and its offset. The shader knows the size of the target from that of fields.
const vertexShader = (shift: string) => `
uniform isampler2DArray fields;
uniform sampler2D corrections;
flat out vec3 start;
void main() {
  vec4 found = texelFetch(corrections, texelOf(gl_VertexID), 0);
  vec2 texel = vec2(texelOf(int(found.x))) + 0.5;
  gl_Position = vec4(texel / vec2(textureSize(fields, 0)) * 2.0 - 1.0, 0.0, 1.0);
  gl_PointSize = 1.0;
  start = ${shift} + found.yzw;
}`;

/** A uniform with a table of floats. */
export interface TableUniform {
  value: THREE.DataTexture | null;
}

/**
 * Corrected vertices are drawn again, as points over their texels, since not every GPU can blend
 * floats.
 */
export class CorrectedPoints {
  readonly #points: THREE.Points<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  readonly #uniform: TableUniform = { value: null };
  readonly #setTable: (uniform: TableUniform, data: Float32Array) => void;

  /**
   * @param triangle - draws all texels before
   * @param shift - GLSL of the vector that is added to all sums
   * @param prelude - GLSL at the start of every shader
   * @param setTable - sets the first entries of a table, or creates it
   */
  constructor(
    triangle: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>,
    shift: string,
    prelude: string,
    setTable: (uniform: TableUniform, data: Float32Array) => void,
  ) {
    this.#setTable = setTable;
    const { fragmentShader, uniforms } = triangle.material;
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: prelude + vertexShader(shift),
      fragmentShader,
      uniforms: { ...uniforms, corrections: this.#uniform },
    });
    this.#points = new THREE.Points(new THREE.BufferGeometry(), material);
    this.#points.frustumCulled = false;
    this.#points.renderOrder = 1;
    triangle.add(this.#points);
  }

  /** Set the corrections of the next picture. */
  set(offsets: Corrections["offsets"] | undefined): void {
    const size = offsets?.size ?? 0;
    const { geometry } = this.#points;
    this.#points.visible = size > 0;
    if (!offsets || size === 0) return;
    geometry.setDrawRange(0, size);
    const entries = [...offsets].flatMap(([vertex, offset]) => [vertex, ...offset]);
    this.#setTable(this.#uniform, Float32Array.from(entries));
  }

  dispose(): void {
    this.#uniform.value?.dispose();
    this.#points.geometry.dispose();
    this.#points.material.dispose();
  }
}
