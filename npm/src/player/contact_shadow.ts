// The soft shadow of a model on the floor below it, darkest where it touches the floor.

import {
  BufferGeometry,
  Camera,
  DoubleSide,
  GLSL3,
  LinearFilter,
  LinearMipmapLinearFilter,
  Mesh,
  RawShaderMaterial,
  type Scene,
  Vector3,
  type WebGLRenderer,
  WebGLRenderTarget,
} from "../webgl/index.js";
import { boundsOf } from "./framing.js";

/** Width and height in pixels of the nearness to the floor, and of the shadow. */
const [NEARNESS_SIZE, SHADOW_SIZE] = [256, 64];

/** Width of the floor and gap below the model, relative to the width of the model. */
const [FLOOR_SCALE, GAP] = [1.4, 0.01];

const VERTEX = `
precision highp float;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
out vec2 place;
void main() {
  place = position.xz * 0.5 + 0.5;
  gl_Position = `;

const FRAGMENT = `
precision highp float;
uniform sampler2D map;
in vec2 place;
out vec4 shown;
void main() {`;

const ON_FLOOR = "projectionMatrix * modelViewMatrix * vec4(position, 1.0);}";
const COPY = "shown = texture(map, place);}";

// A sharp shadow of what is near the floor, and a wide one of the rest: means with Gaussian weights.
const ON_TARGET = "vec4(position.xz, 0.0, 1.0);}";
const BLUR = `
  vec2 dark;
  float total;
  for (int i = 0; i < 49; i++) {
    vec2 offset = vec2(i % 7, i / 7) - 3.0;
    float weight = exp(-0.2 * dot(offset, offset));
    float near = textureLod(map, 0.007 * offset + place, 1.5).a;
    float far = textureLod(map, 0.04 * offset + place, 3.5).a;
    dark += weight * vec2(pow(near, 8.0), far * far);
    total += weight;
  }
  shown = vec4(0.0, 0.0, 0.0, dot(dark, vec2(0.5, 0.3)) / total);
}`;

const CORNERS = [[-1, -1], [-1, 1], [1, -1], [1, -1], [-1, 1], [1, 1]].map(([x, z]) => new Vector3(x, 0, z));

/** A floor that shows the shadow of a scene; invisible until it is placed. */
export class ContactShadow {
  readonly floor: Mesh;
  readonly #blur: Mesh;
  /** Looks up from the floor, with x to the right and z up. */
  readonly #camera = new Camera();
  readonly #nearness = target(NEARNESS_SIZE, LinearMipmapLinearFilter);
  readonly #shadow = target(SHADOW_SIZE, LinearFilter);
  /** Height of the model, and level of the floor in its coordinates. */
  #height = 0;
  #level = 0;

  constructor() {
    this.floor = square(ON_FLOOR, COPY, this.#shadow, { transparent: true, depthWrite: false });
    this.floor.visible = false;
    this.#blur = square(ON_TARGET, BLUR, this.#nearness, { side: DoubleSide });
    this.#camera.axes[1].set(0, 0, 1);
    this.#camera.axes[2].set(0, -1, 0);
  }

  /** Place the floor under points, at the level of the lowest of others. */
  place(points: readonly Vector3[], others: readonly Vector3[]): void {
    const { low, high } = boundsOf(points);
    const width = Math.max(high.x - low.x, high.z - low.z);
    this.#level = boundsOf(others).low.y - GAP * width;
    this.#height = high.y - low.y + GAP * width;
    this.floor.position.set((low.x + high.x) / 2, 0, (low.z + high.z) / 2);
    this.floor.scale.set((FLOOR_SCALE * width) / 2, 1, (FLOOR_SCALE * width) / 2);
    this.floor.visible = width > 0;
  }

  /** Draw the shadow of a scene whose model has its origin at this height. */
  update(renderer: WebGLRenderer, scene: Scene, y: number): void {
    const { position, scale, visible } = this.floor;
    if (!visible) return;
    position.y = this.#level + y;
    this.#camera.position.copy(position);
    this.#camera.projectionMatrix.elements =
      [1 / scale.x, 0, 0, 0, 0, 1 / scale.x, 0, 0, 0, 0, -2 / this.#height, 0, 0, 0, -1, 1];
    scene.isShadow = true;
    renderer.setRenderTarget(this.#nearness);
    renderer.render(scene, this.#camera);
    scene.isShadow = false;
    renderer.setRenderTarget(this.#shadow);
    renderer.render(this.#blur, this.#camera);
    renderer.setRenderTarget(null);
  }
}

function target(size: number, minFilter: number): WebGLRenderTarget {
  const generateMipmaps = minFilter === LinearMipmapLinearFilter;
  return new WebGLRenderTarget(size, size, { depthBuffer: false, generateMipmaps, minFilter, magFilter: LinearFilter });
}

/** Create a square with the ends of its shaders and the texture that they read. */
function square(
  vertex: string,
  fragment: string,
  { texture }: WebGLRenderTarget,
  options: Partial<RawShaderMaterial>,
): Mesh {
  const material = new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: VERTEX + vertex,
    fragmentShader: FRAGMENT + fragment,
    uniforms: { map: { value: texture } },
    ...options,
  });
  return new Mesh(new BufferGeometry().setFromPoints(CORNERS), material);
}
