// A pass: a shader that runs once for each texel of a target, that is for each vertex.

import * as THREE from "three";

const COVER = `
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

const CAMERA = new THREE.Camera();

/** GLSL that every shader here begins with. */
export const PRECISION = `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
precision highp isampler2DArray;
`;

/** A material that is nothing but our own shaders, which writes neither depth nor blends. */
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
    depthTest: false,
    depthWrite: false,
    blending: THREE.NoBlending,
  });
}

export class Pass {
  private readonly scene = new THREE.Scene();

  /** `fragmentShader` computes the texel at gl_FragCoord. */
  constructor(fragmentShader: string, uniforms: Record<string, THREE.IUniform>) {
    const cover = new THREE.BufferGeometry();
    cover.setDrawRange(0, 3);
    this.add(new THREE.Mesh(cover, passMaterial(COVER, fragmentShader, uniforms)));
  }

  /** Draws something more into the target, after the texels are computed. */
  add(object: THREE.Mesh | THREE.Points): void {
    object.frustumCulled = false;
    object.renderOrder = this.scene.children.length;
    this.scene.add(object);
  }

  run(renderer: THREE.WebGLRenderer, target: THREE.WebGLRenderTarget): void {
    const before = renderer.getRenderTarget();
    renderer.setRenderTarget(target);
    renderer.render(this.scene, CAMERA);
    renderer.setRenderTarget(before);
  }
}
