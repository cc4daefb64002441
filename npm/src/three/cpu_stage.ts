// Pictures without a GPU, or for renderers that are not WebGL 2.

import * as THREE from "three";

import type { BlockFields } from "../types.js";
import { normalsOf, positionsOf } from "./cpu_frames.js";
import type { HeldBlock, Picture } from "./held_block.js";
import type { Setting, Stage, ValueSetup, ValueStage } from "./stage.js";

/** Computes positions and normals on the CPU, and has three.js send them to the GPU. */
export class CpuStage implements Stage {
  readonly #setting: Setting;
  readonly #geometry: THREE.BufferGeometry;
  readonly isOnGpu = false;
  readonly #fields = new Map<HeldBlock, Int16Array>();
  readonly #positions: Float32Array;
  readonly #normals: Float32Array;
  readonly #attributes: readonly (readonly [THREE.BufferAttribute, Float32Array, Uint32Array])[];

  constructor(
    setting: Setting,
    geometry: THREE.BufferGeometry,
  ) {
    this.#setting = setting;
    this.#geometry = geometry;
    const { info, drawing } = setting;
    this.#positions = new Float32Array(3 * info.nVerts);
    this.#normals = new Float32Array(3 * (drawing.shading?.vertices.length ?? info.nVerts));
    const attribute = (name: string) => {
      const made = new THREE.BufferAttribute(new Float32Array(3 * drawing.sources.length), 3);
      geometry.setAttribute(name, made.setUsage(THREE.DynamicDrawUsage));
      return made;
    };
    this.#attributes = [
      [attribute("position"), this.#positions, drawing.sources],
      [attribute("normal"), this.#normals, drawing.rows],
    ];
  }

  canHold(): boolean {
    return true;
  }

  hold(block: BlockFields, held: HeldBlock): void {
    this.#fields.set(held, block.fields);
  }

  release(block: HeldBlock): void {
    this.#fields.delete(block);
  }

  show(picture: Picture): void {
    const { triangles, drawing, shift } = this.#setting;
    const fieldsOf = (block: HeldBlock) => this.#fields.get(block) as Int16Array;
    positionsOf(picture, fieldsOf, shift, this.#positions);
    normalsOf(this.#positions, triangles, this.#normals, drawing.shading?.triangles);
    for (const [attribute, values, rows] of this.#attributes) {
      spread(values, rows, attribute.array as Float32Array);
      attribute.needsUpdate = true;
    }
  }

  read(into: Float32Array): void {
    spread(this.#positions, this.#setting.drawing.sources, into);
  }

  values({ nItems, items, name, width, coordinates }: ValueSetup): ValueStage {
    const geometry = this.#geometry;
    const fields = new Map<HeldBlock, Int16Array>();
    const sums = new Float32Array(3 * nItems);
    const before = geometry.getAttribute(name);
    const attribute = new THREE.BufferAttribute(new Float32Array(width * items.length), width);
    geometry.setAttribute(name, attribute.setUsage(THREE.DynamicDrawUsage));
    return {
      hold: (block, held) => void fields.set(held, block.fields),
      release: (block) => void fields.delete(block),
      show(picture) {
        positionsOf(picture, (block) => fields.get(block) as Int16Array, [0, 0, 0], sums);
        items.forEach((item, i) => attribute.array.set(coordinates(sums, 3 * item), width * i));
        attribute.needsUpdate = true;
      },
      dispose() {
        geometry.dispose(); // the buffers of all that it has, which are sent again
        geometry.deleteAttribute(name);
        if (before) geometry.setAttribute(name, before);
      },
    };
  }

  dispose(): void {
    this.#fields.clear();
  }
}

/** Three numbers of each source. */
function spread(values: Float32Array, sources: Uint32Array, into: Float32Array): void {
  for (let i = 0; i < into.length; i++) {
    into[i] = values[3 * sources[Math.floor(i / 3)] + (i % 3)];
  }
}
