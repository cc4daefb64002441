// Draws edges over the faces of a mesh.

import { BufferGeometry, GLSL3, LineSegments, RawShaderMaterial, Sphere, Vector4 } from "../../webgl/index.js";

// Lines are moved towards the camera by "lift", so that adjacent faces do not hide them.
const VERTEX = `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform float lift;
in vec3 position;
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  seen.xyz *= 1.0 - min(lift / max(length(seen.xyz), 1e-30), 0.5);
  gl_Position = projectionMatrix * seen;
}`;

const FRAGMENT = `
precision highp float;
uniform vec4 lineColor;
out vec4 color;
void main() { color = vec4(lineColor.rgb * lineColor.a, lineColor.a); }`;

/** Line segments along edges, in one color. */
export class EdgeLines extends LineSegments<BufferGeometry, RawShaderMaterial> {
  constructor() {
    super(
      new BufferGeometry(),
      new RawShaderMaterial({
        glslVersion: GLSL3,
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        uniforms: { lineColor: { value: new Vector4() }, lift: { value: 0 } },
        depthWrite: false,
        transparent: true,
        premultipliedAlpha: true,
      }),
    );
    this.visible = false;
    this.renderOrder = 1;
    this.frustumCulled = false;
    this.geometry.boundingSphere = new Sphere(); // positions are on the GPU, so that it cannot be computed
  }

  /** Set the color, and the offset towards the camera in model units. */
  setStyle(color: readonly [number, number, number, number], lift: number): void {
    this.material.uniforms.lineColor.value.set(...color);
    this.material.uniforms.lift.value = lift;
  }
}
