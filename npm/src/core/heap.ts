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
  private free: Span[] = [];
  /** Bytes currently allocated. */
  usedBytes = 0;

  constructor(
    private readonly memory: WebAssembly.Memory,
    start: number,
  ) {
    this.addSpan(alignUp(start), memory.buffer.byteLength);
  }

  /**
   * Allocate memory, aligned to 64 bytes and not cleared; returns its address, or 0 if memory is
   * exhausted. May grow the WebAssembly memory, which detaches existing views of it.
   */
  allocate(sizeBytes: number): number {
    const size = alignUp(sizeBytes);
    const fits = ({ start, end }: Span): boolean => end - start >= size;
    const span = this.free.find(fits) ?? (this.grow(size) ? this.free.find(fits) : undefined);
    if (!span) return 0;
    this.usedBytes += size;
    span.start += size;
    return span.start - size;
  }

  /** Release memory; `sizeBytes` is the size that was allocated. */
  release(start: number, sizeBytes: number): void {
    const size = alignUp(sizeBytes);
    this.usedBytes -= size;
    this.addSpan(start, start + size);
  }

  /** Grow the memory until a span of `size` bytes is free at its end; returns whether it could. */
  private grow(size: number): boolean {
    const end = this.memory.buffer.byteLength;
    const last = this.free.at(-1);
    const nFree = last?.end === end ? end - last.start : 0;
    const nPages = Math.ceil((size - nFree) / PAGE);
    try {
      this.memory.grow(nPages);
    } catch {
      return false;
    }
    this.addSpan(end, end + nPages * PAGE);
    return true;
  }

  private addSpan(start: number, end: number): void {
    const spans = [...this.free, { start, end }].sort((one, other) => one.start - other.start);
    this.free = [];
    for (const span of spans) {
      const last = this.free.at(-1);
      if (last?.end === span.start) last.end = span.end;
      else if (span.start < span.end) this.free.push(span);
    }
  }
}

function alignUp(size: number): number {
  return Math.ceil(Math.max(size, 1) / ALIGNMENT) * ALIGNMENT;
}
