// Linear memory of the core: parts are given out, and used again once they are given back.

import { MeshReelError } from "../errors.js";

const ALIGNMENT = 64;
const PAGE = 65536;

interface Span {
  start: number;
  end: number;
}

/** Parts of the memory from `start` on. The lowest free one that is large enough is taken first. */
export class Heap {
  /** Ascending, with something between any two. */
  private readonly free: Span[] = [];
  /** The end of each part that was taken, by its start. */
  private readonly taken = new Map<number, number>();
  private end: number;

  constructor(
    private readonly memory: WebAssembly.Memory,
    start: number,
  ) {
    this.end = aligned(start);
  }

  /** Bytes that are taken now. */
  get usedBytes(): number {
    let sum = 0;
    for (const [start, end] of this.taken) sum += end - start;
    return sum;
  }

  /**
   * The address of so many bytes, not filled, aligned as the core asks for. Views of the memory are
   * lost, since it may grow.
   *
   * @throws MeshReelError where there is no such memory.
   */
  take(sizeBytes: number): number {
    const size = aligned(Math.max(sizeBytes, 1));
    const place = this.free.findIndex((span) => span.end - span.start >= size);
    let start = this.end;
    if (place >= 0) {
      const span = this.free[place];
      start = span.start;
      span.start += size;
      if (span.start === span.end) this.free.splice(place, 1);
    } else {
      const last = this.free.at(-1);
      if (last?.end === this.end) start = last.start;
      this.grow(start + size);
      if (start < this.end) this.free.pop();
      this.end = start + size;
    }
    this.taken.set(start, start + size);
    return start;
  }

  /** Gives back the part that begins at `start`. */
  give(start: number): void {
    const end = this.taken.get(start);
    if (end === undefined) return;
    this.taken.delete(start);
    this.release({ start, end });
  }

  /** Keeps only the first bytes of a part. */
  shrink(start: number, sizeBytes: number): void {
    const end = this.taken.get(start);
    const kept = start + aligned(Math.max(sizeBytes, 1));
    if (end === undefined || kept >= end) return;
    this.taken.set(start, kept);
    this.release({ start: kept, end });
  }

  private release(span: Span): void {
    const found = this.free.findIndex((other) => other.start > span.start);
    const place = found < 0 ? this.free.length : found;
    this.free.splice(place, 0, span);
    if (this.free[place + 1]?.start === span.end) {
      span.end = this.free[place + 1].end;
      this.free.splice(place + 1, 1);
    }
    if (this.free[place - 1]?.end === span.start) {
      this.free[place - 1].end = span.end;
      this.free.splice(place, 1);
    }
  }

  private grow(end: number): void {
    const missing = Math.ceil((end - this.memory.buffer.byteLength) / PAGE);
    if (missing <= 0) return;
    try {
      if (missing >= PAGE) throw new RangeError(); // beyond 32 bits
      this.memory.grow(missing);
    } catch {
      const megabytes = Math.ceil((missing * PAGE) / 1e6);
      throw new MeshReelError(`the stream needs ${megabytes} MB more memory than there are`);
    }
  }
}

/** Parts of a heap for one piece of work. */
export class Scope {
  private readonly starts: number[] = [];

  constructor(
    private readonly heap: Heap,
    private readonly memory: WebAssembly.Memory,
  ) {}

  /** As `Heap.take`, until the work ends. */
  take(sizeBytes: number): number {
    const start = this.heap.take(sizeBytes);
    this.starts.push(start);
    return start;
  }

  /** The address of a copy of an array. */
  put(array: ArrayBufferView): number {
    const start = this.take(array.byteLength);
    const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    new Uint8Array(this.memory.buffer).set(bytes, start);
    return start;
  }

  /** Gives back all but the parts that are kept. */
  close(kept: readonly number[] = []): void {
    for (const start of this.starts) if (!kept.includes(start)) this.heap.give(start);
  }
}

function aligned(size: number): number {
  return Math.ceil(size / ALIGNMENT) * ALIGNMENT;
}
