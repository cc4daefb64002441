// The bytes of a file that have been fetched.

import { type Bytes, MissingBytes } from "../core/library.js";

/** Consecutive bytes of a file. */
export interface Range {
  readonly start: number;
  readonly bytes: Uint8Array;
}

/** A set of byte ranges. */
export class Ranges implements Bytes {
  /** Ascending by `start`; ranges may overlap. */
  private readonly ranges: Range[];

  constructor(ranges: readonly Range[] = []) {
    this.ranges = [...ranges];
  }

  add(start: number, bytes: Uint8Array): void {
    this.ranges.push({ start, bytes });
    this.ranges.sort((one, other) => one.start - other.start);
  }

  list(): readonly Range[] {
    return this.ranges;
  }

  has(start: number, end: number): boolean {
    return this.missing(start, end) === null;
  }

  /** The first gap between `start` and `end`; null if there is none. */
  missing(start: number, end: number): readonly [start: number, end: number] | null {
    let position = start;
    for (const range of this.ranges) {
      if (position >= end) return null;
      const rangeEnd = range.start + range.bytes.length;
      if (range.start > position) return [position, Math.min(end, range.start)];
      position = Math.max(position, rangeEnd);
    }
    return position >= end ? null : [position, end];
  }

  /** Copy bytes. @throws MissingBytes if some have not been fetched. */
  slice(start: number, end: number): Uint8Array {
    const bytes = new Uint8Array(end - start);
    if (!this.copy(start, bytes)) throw new MissingBytes(start, end);
    return bytes;
  }

  copy(start: number, into: Uint8Array): boolean {
    const end = start + into.length;
    if (!this.has(start, end)) return false;
    for (const range of this.ranges) {
      const from = Math.max(start, range.start);
      const to = Math.min(end, range.start + range.bytes.length);
      if (from < to) into.set(range.bytes.subarray(from - range.start, to - range.start), from - start);
    }
    return true;
  }
}
