// Fallback without WebGL 2: computes on the CPU.

import * as THREE from "three";

import type { BlockFields } from "../types.js";
import { computeNormals, computePositions, gather } from "./cpu_frames.js";
import type { LoadedBlock, Picture } from "./loaded_block.js";
import type { MeshSegment } from "./mesh_segment.js";
import type { AttributeBackend, Backend, ItemAttributeSetup } from "./backend.js";

/** Computes positions and normals on the CPU; three.js uploads them to the GPU. */
export class CpuBackend implements Backend {
  readonly #segment: MeshSegment;
  readonly isOnGpu = false;
  readonly #fields = new Map<LoadedBlock, Int16Array>();
  readonly #positions: Float32Array;
  readonly #normals: Float32Array;
  readonly #attributes: readonly (readonly [THREE.BufferAttribute, Float32Array, Uint32Array])[];

  constructor(segment: MeshSegment) {
    this.#segment = segment;
    const { reel, drawing, geometry } = segment;
    this.#positions = new Float32Array(3 * reel.info.nVerts);
    this.#normals = new Float32Array(3 * drawing.nRows);
    const attribute = (name: string) => {
      const created = new THREE.BufferAttribute(new Float32Array(3 * drawing.sources.length), 3);
      geometry.setAttribute(name, created.setUsage(THREE.DynamicDrawUsage));
      return created;
    };
    this.#attributes = [
      [attribute("position"), this.#positions, drawing.sources],
      [attribute("normal"), this.#normals, drawing.rows],
    ];
  }

  upload(block: BlockFields, loaded: LoadedBlock): void {
    this.#fields.set(loaded, block.fields);
  }

  release(block: LoadedBlock): void {
    this.#fields.delete(block);
  }

  show(picture: Picture): void {
    const { surface, drawing, shift } = this.#segment;
    const fieldsOf = (block: LoadedBlock) => this.#fields.get(block) as Int16Array;
    computePositions(picture, fieldsOf, shift, this.#positions);
    computeNormals(this.#positions, surface.triangles, this.#normals, drawing.cornerRows);
    for (const [attribute, values, rows] of this.#attributes) {
      gather(values, rows, attribute.array as Float32Array);
      attribute.needsUpdate = true;
    }
  }

  read(vertices: Uint32Array, into: Float32Array): void {
    gather(this.#positions, vertices, into);
  }

  createAttribute({ nItems, items, attributes, shift, evaluate }: ItemAttributeSetup): AttributeBackend {
    const { geometry } = this.#segment;
    const fields = new Map<LoadedBlock, Int16Array>();
    const sums = new Float32Array(3 * nItems);
    const [[name, width]] = attributes;
    const attribute = new THREE.BufferAttribute(new Float32Array(width * items.length), width);
    geometry.setAttribute(name, attribute.setUsage(THREE.DynamicDrawUsage));
    return {
      upload: (block, loaded) => void fields.set(loaded, block.fields),
      release: (block) => void fields.delete(block),
      show(picture) {
        computePositions(picture, (block) => fields.get(block) as Int16Array, shift, sums);
        items.forEach((item, i) => attribute.array.set(evaluate(sums, 3 * item), width * i));
        attribute.needsUpdate = true;
      },
      // Frees the buffers of all attributes; three.js uploads the rest again.
      dispose: () => geometry.dispose(),
    };
  }

  dispose(): void {
    this.#fields.clear();
  }
}
