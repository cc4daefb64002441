// The interface of the GPU and the CPU backend.

import type { BlockFields, ReelInfo } from "../types.js";
import type { Drawing } from "./drawing.js";
import type { LoadedBlock, Picture } from "./loaded_block.js";

/** Computes the attributes "position" and "normal" of a geometry. */
export interface Backend {
  readonly isOnGpu: boolean;
  /** Whether a block fits the limits of the backend. */
  canHold(block: BlockFields): boolean;
  /** Store the fields of a block, which pictures may use until it is released. */
  upload(block: BlockFields, loaded: LoadedBlock): void;
  release(block: LoadedBlock): void;
  show(picture: Picture): void;
  /** Read the current positions, three numbers per vertex of the drawing. */
  read(into: Float32Array): void;
  /** Create another attribute from other fields; the caller disposes of it. */
  createAttribute(setup: AttributeSetup): AttributeBackend;
  dispose(): void;
}

/** An attribute that is computed from sums of fields. */
export interface AttributeSetup {
  readonly nItems: number;
  /** Item of each vertex of the drawing. */
  readonly items: Uint32Array;
  /** Name of the attribute. An existing one of this name is restored by `dispose`. */
  readonly name: string;
  /** Numbers per vertex. */
  readonly width: 2 | 3;
  /** GLSL that sets the attribute from `value`, a vec3; must match `evaluate`. */
  readonly glsl: string;
  evaluate(createAttribute: Float32Array, from: number): readonly number[];
}

/** Computes such an attribute, which is 0 until the first picture. */
export interface AttributeBackend {
  upload(block: BlockFields, loaded: LoadedBlock): void;
  release(block: LoadedBlock): void;
  show(picture: Picture): void;
  dispose(): void;
}

/** What backends need to know about a mesh. */
export interface MeshSetup {
  readonly info: ReelInfo;
  /** Vertex indices of the file, three per triangle. */
  readonly triangles: Uint32Array;
  readonly drawing: Drawing;
  /** Added to positions, which are relative to the center of the file. */
  readonly shift: readonly [number, number, number];
}
