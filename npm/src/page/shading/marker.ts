// Marks a vertex of a mesh.

import { BufferGeometry, GLSL3, Points, RawShaderMaterial, Vector3 } from "../../webgl/index.js";

/** Width in CSS pixels. */
const SIZE = 11;

const VERTEX = `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform float size;
in vec3 position;
void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  gl_PointSize = size;
}`;

const FRAGMENT = `
precision highp float;
out vec4 color;
void main() { color = vec4(1.0, 0.35, 0.8, 1.0); }`;

/** A square at its position, in front of everything. */
export class Marker extends Points<BufferGeometry, RawShaderMaterial> {
  constructor() {
    const shaders = { glslVersion: GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT };
    const material = new RawShaderMaterial({ ...shaders, uniforms: { size: { value: SIZE } }, depthTest: false });
    super(new BufferGeometry().setFromPoints([new Vector3()]), material);
    this.renderOrder = 2;
    this.visible = false;
  }

  setPixelRatio(ratio: number): void {
    this.material.uniforms.size.value = SIZE * ratio;
  }
}
