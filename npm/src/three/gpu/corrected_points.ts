// Draws the corrections of a picture: offsets of single vertices.

import * as THREE from "three";

import { PRELUDE, setTable, type TableUniform } from "./tables.js";

// An entry has the vertex and its offset. The shader knows the size of the target from that of fields.
const VERTEX_SHADER = `${PRELUDE}
uniform vec3 shift;
uniform isampler2DArray fields;
uniform sampler2D corrections;
flat out vec3 start;
void main() {
  vec4 entry = texelFetch(corrections, texelOf(gl_VertexID), 0);
  vec2 texel = vec2(texelOf(int(entry.x))) + 0.5;
  gl_Position = vec4(texel / vec2(textureSize(fields, 0)) * 2.0 - 1.0, 0.0, 1.0);
  gl_PointSize = 1.0;
  start = shift + entry.yzw;
}`;

/**
 * Corrected vertices are drawn again, as points over their texels, since not every GPU can blend
 * floats.
 */
export class CorrectedPoints {
  readonly #points: THREE.Points<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  readonly #uniform: TableUniform = { value: null };

  /** @param triangle - draws all texels before */
  constructor(triangle: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>) {
    const { fragmentShader, uniforms } = triangle.material;
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: VERTEX_SHADER,
      fragmentShader,
      uniforms: { ...uniforms, corrections: this.#uniform },
    });
    this.#points = new THREE.Points(new THREE.BufferGeometry(), material);
    this.#points.frustumCulled = false;
    this.#points.renderOrder = 1;
    triangle.add(this.#points);
  }

  /** Set the corrections of the next picture. */
  set(offsets: ReadonlyMap<number, readonly number[]>): void {
    this.#points.visible = offsets.size > 0;
    if (!offsets.size) return;
    this.#points.geometry.setDrawRange(0, offsets.size);
    const entries = [...offsets].flatMap(([vertex, offset]) => [vertex, ...offset]);
    setTable(this.#uniform, Float32Array.from(entries));
  }

  dispose(): void {
    this.#uniform.value?.dispose();
    this.#points.geometry.dispose();
    this.#points.material.dispose();
  }
}
