// A pass: a shader that runs once for each texel of a target, that is for each vertex.

import * as THREE from "three";

import { PRECISION } from "./vertex_grid";

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

/** Computes the texels of targets. */
export class Pass {
  private readonly scene = new THREE.Scene();
  private readonly drawn: Drawn[] = [];

  /** `fragmentShader` computes the texel at gl_FragCoord. */
  constructor(fragmentShader: string, uniforms: Record<string, THREE.IUniform>) {
    const cover = new THREE.BufferGeometry();
    cover.setDrawRange(0, 3);
    this.add(new THREE.Mesh(cover, passMaterial(COVER, fragmentShader, uniforms)));
  }

  /** Draws something more into the target, after the texels are computed. */
  add(object: Drawn): void {
    object.frustumCulled = false;
    object.renderOrder = this.drawn.length;
    this.drawn.push(object);
    this.scene.add(object);
  }

  /** Must not be called while the renderer draws something else. */
  run(renderer: THREE.WebGLRenderer, target: THREE.WebGLRenderTarget): void {
    const before = renderer.getRenderTarget();
    const face = renderer.getActiveCubeFace();
    const level = renderer.getActiveMipmapLevel();
    const { xr } = renderer;
    const isXrEnabled = xr.enabled;
    xr.enabled = false;
    renderer.setRenderTarget(target);
    renderer.render(this.scene, CAMERA);
    renderer.setRenderTarget(before, face, level);
    xr.enabled = isXrEnabled;
  }

  dispose(): void {
    for (const { geometry, material } of this.drawn) {
      geometry.dispose();
      material.dispose();
    }
  }
}
