// A render pass that computes one texel per vertex.

import * as THREE from "three";

import { PRECISION, type VertexGrid } from "./vertex_grid.js";

// A triangle that covers the target. Objects drawn over it may pass other corrections.
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

/** Create a material of raw shaders; targets have no depth buffer, and blending is off. */
export function passMaterial(
  vertexShader: string,
  fragmentShader: string,
  uniforms: Record<string, THREE.IUniform>,
): THREE.RawShaderMaterial {
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: PRECISION + vertexShader,
    fragmentShader: PRECISION + fragmentShader,
    uniforms,
  });
}

/** Computes the texels of a render target. */
export class Pass {
  readonly target: THREE.WebGLRenderTarget;
  readonly #renderer: THREE.WebGLRenderer;
  readonly #uniforms: Record<string, THREE.IUniform>;
  readonly #scene = new THREE.Scene();
  readonly #objects: PassObject[] = [];

  /**
   * @param fragmentShader - computes the texel at gl_FragCoord
   * @param uniforms - data textures among them are disposed of with the pass
   */
  constructor(
    renderer: THREE.WebGLRenderer,
    grid: VertexGrid,
    fragmentShader: string,
    uniforms: Record<string, THREE.IUniform>,
  ) {
    this.target = grid.target();
    this.#renderer = renderer;
    this.#uniforms = uniforms;
    const triangle = new THREE.BufferGeometry();
    triangle.setDrawRange(0, 3);
    this.add(new THREE.Mesh(triangle, passMaterial(FULL_SCREEN_TRIANGLE, fragmentShader, uniforms)));
  }

  /** Add an object that is drawn over the computed texels. */
  add(object: PassObject): void {
    object.frustumCulled = false;
    object.renderOrder = this.#objects.push(object);
    this.#scene.add(object);
  }

  /** Run the pass; must not be called while the renderer is drawing. */
  run(): void {
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

  dispose(): void {
    this.target.dispose();
    for (const { geometry, material } of this.#objects) {
      geometry.dispose();
      material.dispose();
    }
    for (const { value } of Object.values(this.#uniforms)) {
      if (value instanceof THREE.DataTexture) value.dispose();
    }
  }
}
