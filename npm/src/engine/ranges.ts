// Bytes of a file that have been fetched.

import { type Bytes, MissingBytes } from "../core/library.js";

/** Consecutive bytes of a file. */
export interface Range {
  readonly start: number;
  readonly bytes: Uint8Array;
}

export class Ranges implements Bytes {
  /** Ascending by their first bytes; they may overlap. */
  private readonly all: Range[];

  constructor(ranges: readonly Range[] = []) {
    this.all = [...ranges];
  }

  add(start: number, bytes: Uint8Array): void {
    this.all.push({ start, bytes });
    this.all.sort((one, other) => one.start - other.start);
  }

  /** All ranges. */
  list(): readonly Range[] {
    return this.all;
  }

  has(start: number, end: number): boolean {
    return this.missing(start, end) === null;
  }

  /** The first gap between `start` and `end`; null if there is none. */
  missing(start: number, end: number): readonly [start: number, end: number] | null {
    let at = start;
    for (const range of this.all) {
      if (at >= end) return null;
      const behind = range.start + range.bytes.length;
      if (range.start > at) return [at, Math.min(end, range.start)];
      at = Math.max(at, behind);
    }
    return at >= end ? null : [at, end];
  }

  /** A copy of bytes. @throws MissingBytes if some have not been fetched. */
  slice(start: number, end: number): Uint8Array {
    const found = new Uint8Array(end - start);
    if (!this.copy(start, found)) throw new MissingBytes(start, end);
    return found;
  }

  copy(start: number, into: Uint8Array): boolean {
    const end = start + into.length;
    if (!this.has(start, end)) return false;
    for (const range of this.all) {
      const from = Math.max(start, range.start);
      const to = Math.min(end, range.start + range.bytes.length);
      if (from < to) into.set(range.bytes.subarray(from - range.start, to - range.start), from - start);
    }
    return true;
  }
}
