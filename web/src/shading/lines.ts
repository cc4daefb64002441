// Edges over the faces of a mesh.

import * as THREE from "three";

// Drawn nearer to the eye by "lift": faces that they lie in do not hide them in part.
const VERTEX = `
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
uniform vec4 ink;
out vec4 color;
void main() { color = vec4(ink.rgb * ink.a, ink.a); }`;

export class EdgeLines extends THREE.LineSegments<THREE.BufferGeometry, THREE.RawShaderMaterial> {
  constructor() {
    super(
      new THREE.BufferGeometry(),
      new THREE.RawShaderMaterial({
        glslVersion: THREE.GLSL3,
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        uniforms: { ink: { value: new THREE.Vector4() }, lift: { value: 0 } },
        depthWrite: false,
        transparent: true,
        premultipliedAlpha: true,
      }),
    );
    this.visible = false;
    this.renderOrder = 1;
    this.frustumCulled = false;
    this.geometry.boundingSphere = new THREE.Sphere(); // positions are on the GPU; none is found
  }

  /** Draws in this ink, nearer to the eye by `lift`, in model units. */
  rule(ink: readonly [number, number, number, number], lift: number): void {
    this.material.uniforms.ink.value.set(...ink);
    this.material.uniforms.lift.value = lift;
  }
}
