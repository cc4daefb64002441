// The interface of the GPU and the CPU backend.

import type { BlockFields } from "../types.js";
import type { LoadedBlock, Picture } from "./loaded_block.js";

/** Computes the attributes "position" and "normal" of a geometry. */
export interface Backend {
  readonly isOnGpu: boolean;
  /**
   * Store the fields of a block, which pictures may use until it is released.
   *
   * @throws Error if the block has too many modes for the GPU
   */
  upload(block: BlockFields, loaded: LoadedBlock): void;
  release(block: LoadedBlock): void;
  show(picture: Picture): void;
  /** Read the current positions of vertices of the file, three numbers each. */
  read(vertices: Uint32Array, into: Float32Array): void;
  /** Create an attribute from other fields; the caller disposes of it, and deletes the attribute. */
  createAttribute(setup: ItemAttributeSetup): AttributeBackend;
  dispose(): void;
}

/** Attributes that are computed from sums of fields, three numbers per item. */
export interface AttributeSetup {
  readonly nItems: number;
  /** Added to the sums. */
  readonly shift: readonly number[];
  /** Vertices of the geometry. */
  readonly nVerts: number;
  /** Names and numbers per vertex. */
  readonly attributes: readonly (readonly [name: string, width: 2 | 3])[];
  /** Pairs of integers for the shader. */
  readonly table: Uint32Array;
  /**
   * GLSL that declares the attributes, and whose function `main` sets those of the vertex
   * `gl_VertexID`. `sumOf(item)` is the sum of an item, and `pairAt(entry)` an entry of the table.
   */
  readonly glsl: string;
}

/** An attribute that depends only on the item of each vertex. */
export interface ItemAttributeSetup extends AttributeSetup {
  readonly items: Uint32Array;
  /** Compute the same as the GLSL from the sum that starts at a place. */
  evaluate(sums: Float32Array, from: number): readonly number[];
}

/** Computes attributes, which are 0 until the first picture. */
export interface AttributeBackend {
  upload(block: BlockFields, loaded: LoadedBlock): void;
  release(block: LoadedBlock): void;
  show(picture: Picture): void;
  dispose(): void;
}
