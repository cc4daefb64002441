// First-fit allocator in the linear memory of the library.

const ALIGNMENT = 64;
const PAGE = 65536;

interface Span {
  start: number;
  end: number;
}

/** Allocates the memory from address `start` upwards, first fit. */
export class Heap {
  /** Free spans in ascending order; adjacent spans are merged. */
  private readonly free: Span[] = [];
  private end: number;
  /** Bytes currently allocated. */
  usedBytes = 0;

  constructor(
    private readonly memory: WebAssembly.Memory,
    start: number,
  ) {
    this.end = alignUp(start);
  }

  /**
   * Allocate memory, aligned to 64 bytes and not cleared; returns its address, or 0 if memory is
   * exhausted. May grow the WebAssembly memory, which detaches existing views of it.
   */
  allocate(sizeBytes: number): number {
    const size = alignUp(sizeBytes);
    const index = this.free.findIndex((span) => span.end - span.start >= size);
    if (index >= 0) {
      const span = this.free[index];
      const { start } = span;
      span.start += size;
      if (span.start === span.end) this.free.splice(index, 1);
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

  /** Release memory; `sizeBytes` is the size that was allocated. */
  release(start: number, sizeBytes: number): void {
    const span = { start, end: start + alignUp(sizeBytes) };
    this.usedBytes -= span.end - span.start;
    const found = this.free.findIndex((other) => other.start > start);
    const index = found < 0 ? this.free.length : found;
    this.free.splice(index, 0, span);
    if (this.free[index + 1]?.start === span.end) {
      span.end = this.free[index + 1].end;
      this.free.splice(index + 1, 1);
    }
    if (this.free[index - 1]?.end === span.start) {
      this.free[index - 1].end = span.end;
      this.free.splice(index, 1);
    }
  }

  private grow(end: number): boolean {
    const nPages = Math.ceil((end - this.memory.buffer.byteLength) / PAGE);
    if (nPages <= 0) return true;
    try {
      this.memory.grow(nPages);
      return true;
    } catch {
      return false;
    }
  }
}

function alignUp(size: number): number {
  return Math.ceil(Math.max(size, 1) / ALIGNMENT) * ALIGNMENT;
}
