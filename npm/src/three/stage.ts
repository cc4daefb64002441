// Where positions are computed: on the GPU or the CPU.

import type { BlockFields, ReelInfo } from "../types.js";
import type { Drawing } from "./drawing.js";
import type { HeldBlock, Picture } from "./held_block.js";

/** Computes pictures into the attributes "position" and "normal" of a geometry. */
export interface Stage {
  readonly isOnGpu: boolean;
  /** Whether a block is not too large for it. */
  canHold(block: BlockFields): boolean;
  /** Takes the fields of a block, which may come into pictures until it is released. */
  hold(block: BlockFields, held: HeldBlock): void;
  release(block: HeldBlock): void;
  show(picture: Picture): void;
  /** Positions as they are shown, three numbers for each vertex of the drawing. */
  read(into: Float32Array): void;
  /** Another attribute of the geometry, of other fields; whoever asks disposes of it. */
  values(setup: ValueSetup): ValueStage;
  dispose(): void;
}

/** An attribute of two or three numbers, made of sums of fields. */
export interface ValueSetup {
  readonly nItems: number;
  /** The item of each vertex of the drawing. */
  readonly items: Uint32Array;
  /** Of the attribute; one that was there before comes back. */
  readonly name: string;
  /** Its numbers. */
  readonly width: 2 | 3;
  /** Sets the attribute from `value`, a vec3, in GLSL; `coordinates` does the same. */
  readonly glsl: string;
  coordinates(values: Float32Array, from: number): readonly number[];
}

/** Computes pictures into such an attribute; until the first it is all zero. */
export interface ValueStage {
  hold(block: BlockFields, held: HeldBlock): void;
  release(block: HeldBlock): void;
  show(picture: Picture): void;
  dispose(): void;
}

/** What stages need to know of a mesh. */
export interface Setting {
  readonly info: ReelInfo;
  /** Of the file: 3 nFaces numbers of vertices. */
  readonly triangles: Uint32Array;
  readonly drawing: Drawing;
  /** Is added to positions, which count from the centre of the file. */
  readonly shift: readonly [number, number, number];
}
