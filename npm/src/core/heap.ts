// Linear memory of the library: it is given out in parts, and used again once they are released.

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
  private end: number;
  /** Bytes that are taken. */
  usedBytes = 0;

  constructor(
    private readonly memory: WebAssembly.Memory,
    start: number,
  ) {
    this.end = aligned(start);
  }

  /**
   * The address of so many bytes, not filled, aligned to 64; 0 where there is no such memory. Views
   * of the memory are lost, since it may grow.
   */
  take(sizeBytes: number): number {
    const size = aligned(sizeBytes);
    const place = this.free.findIndex((span) => span.end - span.start >= size);
    if (place >= 0) {
      const span = this.free[place];
      const { start } = span;
      span.start += size;
      if (span.start === span.end) this.free.splice(place, 1);
      this.usedBytes += size;
      return start;
    }
    const last = this.free.at(-1);
    const start = last?.end === this.end ? last.start : this.end;
    if (!this.grow(start + size)) return 0;
    if (start < this.end) this.free.pop();
    this.end = start + size;
    this.usedBytes += size;
    return start;
  }

  /** Release a part, of the size that was taken. */
  release(start: number, sizeBytes: number): void {
    const span = { start, end: start + aligned(sizeBytes) };
    this.usedBytes -= span.end - span.start;
    const found = this.free.findIndex((other) => other.start > start);
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

  private grow(end: number): boolean {
    const missing = Math.ceil((end - this.memory.buffer.byteLength) / PAGE);
    if (missing <= 0) return true;
    try {
      this.memory.grow(missing);
      return true;
    } catch {
      return false;
    }
  }
}

function aligned(size: number): number {
  return Math.ceil(Math.max(size, 1) / ALIGNMENT) * ALIGNMENT;
}
