// A decoded block of frames: fields, how they move, and corrections.

import { InvalidInputError } from "../errors.js";
import type { Layout } from "../stream/block_sections.js";
import type { Corrections } from "./corrections.js";
import type { FieldValues } from "./field_values.js";

/** What frames of a block are made of. Its values stay in the memory of the core until `close`. */
export class DecodedBlock {
  private isOpen = true;

  /**
   * @param number - Of the block.
   * @param start - Number of its first frame.
   * @param basis - Basis vectors of shape (C, T, K).
   * @param rows - Row of `values` of each vertex that goes out.
   */
  constructor(
    readonly number: number,
    readonly start: number,
    readonly nFrames: number,
    readonly nVerts: number,
    readonly nColumns: number,
    readonly layout: Layout,
    readonly basis: Float64Array,
    readonly corrections: Corrections,
    private readonly held: FieldValues,
    readonly rows: Int32Array,
  ) {}

  /** Its fields. @throws InvalidInputError once it is closed. */
  get values(): FieldValues {
    if (!this.isOpen) throw new InvalidInputError(`block ${this.number} is closed`);
    return this.held;
  }

  get nModes(): number {
    return this.held.nModes;
  }

  /** Gives its memory back; more than once does nothing. */
  close(): void {
    if (this.isOpen) this.held.release();
    this.isOpen = false;
  }
}
