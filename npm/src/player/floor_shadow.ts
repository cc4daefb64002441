// The shadow of a model on an invisible floor: a map of the depth from the light, blurred as mean and
// deviation, from which the floor estimates how much of the light arrives (variance shadow map).

import {
  BufferGeometry,
  Camera,
  FloatType,
  GLSL3,
  LinearFilter,
  Matrix4,
  Mesh,
  RGFormat,
  RawShaderMaterial,
  Scene,
  Vector3,
  WebGLRenderTarget,
  type WebGLRenderer,
} from "../webgl/index.js";
import type { HalfExtents } from "./half_extents.js";

/** Pixels of the shadow map per side, and the width of its soft edge in pixels. */
const [MAP_SIZE, SOFTNESS] = [1024, 8];

/** Direction to the light, which is nearly above. */
const [LIGHT_X, LIGHT_Z] = [-0.15, 0.2];

const BLURRED = {
  ...{ type: FloatType, format: RGFormat, internalFormat: "RG16F", depthBuffer: false },
  ...{ minFilter: LinearFilter, magFilter: LinearFilter },
};

const BLUR_VERTEX = `
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

// The mean and the standard deviation of 8 samples along a line.
const BLUR = `
precision highp float;
uniform sampler2D depths;
uniform vec2 step;
uniform bool isDepth;
out vec4 result;
void main() {
  vec2 sum = vec2(0.0);
  for (float i = -1.0; i <= 1.001; i += 2.0 / 7.0) {
    vec2 found = texture(depths, gl_FragCoord.xy / ${MAP_SIZE}.0 + i * step).rg;
    sum += vec2(found.r, found.r * found.r + (isDepth ? 0.0 : found.g * found.g)) / 8.0;
  }
  result = vec4(sum.r, sqrt(max(sum.g - sum.r * sum.r, 0.0)), 0.0, 1.0);
}`;

/** Corners of two triangles that face up. */
const SQUARE = [[0, 0], [0, 1], [1, 0], [1, 0], [0, 1], [1, 1]];

const FLOOR_VERTEX = `
precision highp float;
uniform mat4 modelMatrix;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform mat4 toLight;
in vec3 position;
out vec3 place;
void main() {
  vec4 point = modelMatrix * vec4(position, 1.0);
  place = (toLight * point).xyz * 0.5 + 0.5;
  gl_Position = projectionMatrix * viewMatrix * point;
}`;

const FLOOR = `
precision highp float;
uniform sampler2D depths;
uniform float opacity;
in vec3 place;
out vec4 color;
void main() {
  vec2 found = texture(depths, place.xy).rg;
  float variance = max(found.g * found.g, 1e-7);
  float behind = place.z - found.r;
  float lit = behind <= 0.0 ? 1.0 : clamp((variance / (variance + behind * behind) - 0.3) / 0.65, 0.0, 1.0);
  color = vec4(0.0, 0.0, 0.0, opacity * (1.0 - lit));
}`;

type Floor = Mesh<BufferGeometry, RawShaderMaterial>;

/** A floor that shows only the shadow of meshes with `castShadow`. */
export class FloorShadow {
  readonly mesh: Floor;
  readonly #depth = new WebGLRenderTarget(MAP_SIZE, MAP_SIZE, {});
  /** The depth blurred along one axis, then along both. */
  readonly #blurred = [0, 1].map(() => new WebGLRenderTarget(MAP_SIZE, MAP_SIZE, BLURRED));
  readonly #light = new Camera();
  readonly #toLight = new Matrix4();
  readonly #opacity = { value: 0 };
  readonly #passes: readonly Scene[];

  constructor() {
    this.#passes = [this.#depth.depthTexture, this.#blurred[0].texture].map((texture, i) => {
      const step = [i, 1 - i].map((one) => (one * SOFTNESS) / MAP_SIZE);
      const uniforms = { depths: { value: texture }, step: { value: step }, isDepth: { value: i === 0 } };
      const shaders = { glslVersion: GLSL3, vertexShader: BLUR_VERTEX, fragmentShader: BLUR };
      const blur = new RawShaderMaterial({ ...shaders, uniforms });
      const triangle = new BufferGeometry();
      triangle.setDrawRange(0, 3);
      return new Scene().add(new Mesh(triangle, blur));
    });
    const shaders = { glslVersion: GLSL3, vertexShader: FLOOR_VERTEX, fragmentShader: FLOOR };
    const depths = { value: this.#blurred[1].texture };
    const uniforms = { depths, opacity: this.#opacity, toLight: { value: this.#toLight } };
    const floor = new RawShaderMaterial({ ...shaders, uniforms, transparent: true });
    const corners = SQUARE.map(([x, z]) => new Vector3(x - 0.5, 0, z - 0.5));
    this.mesh = new Mesh(new BufferGeometry().setFromPoints(corners), floor);
    this.mesh.castShadow = true; // blurring needs the depth beside the shadow
  }

  /** Opacity of the shadow, 0 to 1. */
  set intensity(value: number) {
    this.#opacity.value = value;
  }

  /** Place the floor below a box around the origin, with y up. */
  fit(extents: HalfExtents): void {
    const radius = Math.hypot(...extents);
    this.mesh.position.y = -extents[1] - 1e-3 * radius;
    this.mesh.scale.setScalar(3 * radius); // inside of the shadow map, whose edges are visible
    const light = this.#light;
    light.position.set(LIGHT_X, 1, LIGHT_Z).multiplyScalar(2 * radius);
    light.lookAt(new Vector3());
    light.updateMatrixWorld();
    light.projectionMatrix.setOrthographic(2 * radius, 2 * radius, 0.2 * radius, 5 * radius);
    this.#toLight.multiplyMatrices(light.projectionMatrix, new Matrix4().copyInverse(light.matrixWorld));
  }

  /** Compute the shadow map of a scene. */
  update(renderer: WebGLRenderer, scene: Scene): void {
    const before = renderer.getRenderTarget();
    renderer.setRenderTarget(this.#depth);
    renderer.render(scene, this.#light, { isDepth: true });
    this.#passes.forEach((pass, i) => {
      renderer.setRenderTarget(this.#blurred[i]);
      renderer.render(pass, this.#light);
    });
    renderer.setRenderTarget(before);
  }

  dispose(): void {
    this.mesh.removeFromParent();
    for (const one of [this.#depth, ...this.#blurred]) one.dispose();
    for (const { material, geometry } of [this.mesh, ...this.#passes.map(({ children }) => children[0] as Floor)]) {
      material.dispose();
      geometry.dispose();
    }
  }
}
