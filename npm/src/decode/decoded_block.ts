// A decoded block of frames: fields, how they move, and corrections.

import type { Core } from "../core/core.js";
import { InvalidInputError } from "../errors.js";
import type { Layout } from "../stream/block_sections.js";
import type { Corrections } from "./corrections.js";
import type { FieldValues } from "./field_values.js";

/** What frames of a block are made of. Its values stay in the memory of the core until `close`. */
export class DecodedBlock {
  private isOpen = true;
  private packed: { readonly core: Core; readonly start: number } | null = null;

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

  /**
   * Address of the fields as frames are multiplied of them. They are packed once, for the first
   * frame: pages that leave the product to the graphics card never need them.
   *
   * @throws InvalidInputError once it is closed.
   */
  packedFields(core: Core): number {
    const { values, nVerts, nModes, layout } = this;
    if (this.packed) return this.packed.start;
    const counts = [BigInt(nModes), BigInt(nVerts)] as const;
    const precision = BigInt(layout.precision);
    return core.keeping((scope, keep) => {
      const { reel_packed_bytes, reel_pack } = core.functions;
      const start = keep(scope.take(reel_packed_bytes(...counts, precision) >>> 0));
      const order = scope.put(this.rows);
      const fields = [values.start, 1n, counts[0], layout.step, precision, order] as const;
      core.checked(reel_pack(...fields, ...counts, 0n, counts[1], start), "fields");
      this.packed = { core, start };
      return start;
    });
  }

  /** Gives its memory back; more than once does nothing. */
  close(): void {
    if (this.isOpen) this.held.release();
    this.isOpen = false;
    this.packed?.core.heap.give(this.packed.start);
    this.packed = null;
  }
}
