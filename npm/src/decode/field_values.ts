// Decoded fields of a block, in the memory of the core.

import type { Core } from "../core/core.js";

/** Fields of shape (V, K), of doubles in quantisation steps, vertices in the order of coding. */
export class FieldValues {
  private nUsers = 1;

  /** @param start - Address of the values, which are given back with the last use. */
  constructor(
    private readonly core: Core,
    readonly start: number,
    readonly nModes: number,
    readonly stencilSize: number,
  ) {}

  /** Notes one more use; each ends with `release`. */
  hold(): this {
    this.nUsers++;
    return this;
  }

  /** Ends a use. */
  release(): void {
    if (--this.nUsers === 0) this.core.heap.give(this.start);
  }
}
