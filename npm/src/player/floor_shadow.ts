// The shadow of a model on an invisible floor.

import {
  DirectionalLight,
  Group,
  Mesh,
  PlaneGeometry,
  ShadowMaterial,
  VSMShadowMap,
  type WebGLRenderer,
} from "three";

import type { HalfExtents } from "./half_extents.js";

/** Pixels of the shadow map per side, and the width of its soft edge in pixels. */
const [MAP_SIZE, SOFTNESS] = [1024, 8];

/** Direction to the light, which is nearly above. */
const [LIGHT_X, LIGHT_Z] = [-0.15, 0.2];

/** A floor that shows only the shadow of meshes with `castShadow`. */
export class FloorShadow {
  readonly group = new Group();
  readonly #material = new ShadowMaterial();
  readonly #floor = new Mesh(new PlaneGeometry(1, 1), this.#material);
  /** Casts a shadow, but adds no light. */
  readonly #light = new DirectionalLight(0xffffff, 0);

  constructor(renderer: WebGLRenderer) {
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = VSMShadowMap;
    const light = this.#light;
    light.castShadow = true;
    light.shadow.mapSize.set(MAP_SIZE, MAP_SIZE);
    light.shadow.radius = SOFTNESS;
    this.#floor.rotation.x = -Math.PI / 2;
    this.#floor.receiveShadow = true;
    this.group.add(light, light.target, this.#floor);
  }

  /** Opacity of the shadow, 0 to 1. */
  set intensity(value: number) {
    this.#material.opacity = value;
  }

  /** Place the floor below a box around the origin, with y up. */
  fit(extents: HalfExtents): void {
    const radius = Math.hypot(...extents);
    this.#floor.position.y = -extents[1] - 1e-3 * radius;
    this.#floor.scale.setScalar(3 * radius); // inside of the shadow map, whose edges are visible
    this.#light.position.set(LIGHT_X, 1, LIGHT_Z).multiplyScalar(2 * radius);
    const { camera } = this.#light.shadow;
    const side = 2 * radius;
    Object.assign(camera, { left: -side, right: side, top: side, bottom: -side });
    Object.assign(camera, { near: 0.2 * radius, far: 5 * radius });
    camera.updateProjectionMatrix();
  }

  dispose(): void {
    this.group.removeFromParent();
    this.#floor.geometry.dispose();
    this.#material.dispose();
    this.#light.dispose();
  }
}
