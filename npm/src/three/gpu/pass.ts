// A pass: a shader that runs once for each texel of a target, that is for each vertex.

import * as THREE from "three";

import { PRECISION, type VertexGrid } from "./vertex_grid.js";

// A triangle over all of the target. What is drawn over it may say how its texels differ.
const COVER = `
flat out vec3 correction;
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
  correction = vec3(0.0);
}`;

const CAMERA = new THREE.Camera();

type Drawn = THREE.Object3D & {
  readonly geometry: THREE.BufferGeometry;
  readonly material: THREE.RawShaderMaterial;
};

/** A material that is nothing but our own shaders; targets have no depth, and nothing blends. */
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

/** Computes the texels of a target. */
export class Pass {
  readonly target: THREE.WebGLRenderTarget;
  readonly #renderer: THREE.WebGLRenderer;
  readonly #uniforms: Record<string, THREE.IUniform>;
  readonly #scene = new THREE.Scene();
  readonly #drawn: Drawn[] = [];

  /**
   * @param fragmentShader - computes the texel at gl_FragCoord
   * @param uniforms - data textures of which are disposed of with the pass
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
    const cover = new THREE.BufferGeometry();
    cover.setDrawRange(0, 3);
    this.add(new THREE.Mesh(cover, passMaterial(COVER, fragmentShader, uniforms)));
  }

  /** Draws something more into the target, after the texels are computed. */
  add(object: Drawn): void {
    object.frustumCulled = false;
    object.renderOrder = this.#drawn.push(object);
    this.#scene.add(object);
  }

  /** Must not be called while the renderer draws something else. */
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
    for (const { geometry, material } of this.#drawn) {
      geometry.dispose();
      material.dispose();
    }
    for (const { value } of Object.values(this.#uniforms)) {
      if (value instanceof THREE.DataTexture) value.dispose();
    }
  }
}
