// Corrections: offsets of single vertices, which few files have. Loaded with the first block that has
// some.

import * as THREE from "three";

import type { VertexGrid } from "./gpu/vertex_grid.js";
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

/** Width of the texture of corrections. */
const WIDTH = 1024;

// A texel of corrections has the vertex and the bits of three floats.
const vertexShader = (grid: VertexGrid) => `${grid.glsl}
uniform usampler2D corrections;
flat out vec3 correction;
void main() {
  ivec2 place = ivec2(gl_VertexID & ${WIDTH - 1}, gl_VertexID >> ${Math.log2(WIDTH)});
  uvec4 found = texelFetch(corrections, place, 0);
  vec2 texel = vec2(texelOf(int(found.x))) + 0.5;
  gl_Position = vec4(texel / vec2(${grid.width}, ${grid.height}) * 2.0 - 1.0, 0.0, 1.0);
  gl_PointSize = 1.0;
  correction = uintBitsToFloat(found.yzw);
}`;

/** A uniform with a texture of texels of four numbers. */
export interface TextureUniform {
  value: THREE.DataTexture | null;
}

/**
 * Corrected vertices are drawn again, as points over their texels, since not every GPU can blend
 * floats.
 */
export class CorrectedPoints {
  readonly object: THREE.Points<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  readonly #uniform: TextureUniform = { value: null };
  readonly #setData: (uniform: TextureUniform, data: Uint32Array<ArrayBuffer>, width: number) => void;

  /**
   * @param createMaterial - creates the material of the pass with another vertex shader
   * @param setData - sets the data of a texture, or creates it
   */
  constructor(
    grid: VertexGrid,
    createMaterial: (
      vertexShader: string,
      uniforms: Record<string, TextureUniform>,
    ) => THREE.RawShaderMaterial,
    setData: (uniform: TextureUniform, data: Uint32Array<ArrayBuffer>, width: number) => void,
  ) {
    this.#setData = setData;
    const material = createMaterial(vertexShader(grid), { corrections: this.#uniform });
    this.object = new THREE.Points(new THREE.BufferGeometry(), material);
  }

  /** Set the corrections of the next picture. */
  set(offsets: Corrections["offsets"] | undefined): void {
    const size = offsets?.size ?? 0;
    this.object.visible = size > 0;
    if (!offsets || size === 0) return;
    this.object.geometry.setDrawRange(0, size);
    const data = new Uint32Array(4 * WIDTH * Math.ceil(size / WIDTH));
    const floats = new Float32Array(data.buffer);
    let at = 0;
    for (const [vertex, offset] of offsets) {
      data[at] = vertex;
      floats.set(offset, at + 1);
      at += 4;
    }
    this.#setData(this.#uniform, data, WIDTH);
  }

  /** Free the texture; the pass disposes of the object. */
  dispose(): void {
    this.#uniform.value?.dispose();
  }
}
