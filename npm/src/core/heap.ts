// Allocation in the linear memory of the library.

const ALIGNMENT = 64;
const PAGE = 65536;

interface Span {
  start: number;
  end: number;
}

/** Memory starting at `start`, allocated first fit. */
export class Heap {
  /** In ascending order; adjacent spans are merged. */
  private readonly free: Span[] = [];
  private end: number;
  /** Bytes allocated now. */
  usedBytes = 0;

  constructor(
    private readonly memory: WebAssembly.Memory,
    start: number,
  ) {
    this.end = aligned(start);
  }

  /**
   * Allocate memory, aligned to 64 bytes and not cleared; returns its address, or 0 if there is not
   * enough. The memory may grow, which detaches views of it.
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

  /** Release memory, of the size that was allocated. */
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
