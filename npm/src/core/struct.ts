// Reads structures of include/meshreel.h from the memory of the library.

const text = new TextDecoder();

/** Reads the fields of a structure in order, at the offsets of the C ABI for WebAssembly. */
export class Struct {
  private readonly view: DataView;

  /** @param offset - Address of the first field. */
  constructor(
    readonly buffer: ArrayBuffer,
    private offset: number,
  ) {
    this.view = new DataView(buffer);
  }

  uint32(): number {
    return this.view.getUint32(this.next(4, 4), true);
  }

  float64(): number {
    return this.view.getFloat64(this.next(8, 8), true);
  }

  /** A `uint64_t`; must be less than 2^53, or UINT64_MAX. */
  uint64(): number {
    return Number(this.view.getBigUint64(this.next(8, 8), true));
  }

  uint32s(count: number): number[] {
    return Array.from({ length: count }, () => this.uint32());
  }

  float64s(count: number): number[] {
    return Array.from({ length: count }, () => this.float64());
  }

  /** A `meshreel_text`. */
  text(): string {
    const [start, size] = this.uint32s(2);
    return text.decode(new Uint8Array(this.buffer, start, size));
  }

  /** A null-terminated string. */
  cString(): string {
    const bytes = new Uint8Array(this.buffer, this.uint32());
    return text.decode(bytes.subarray(0, bytes.indexOf(0)));
  }

  /** An array of structures. */
  array<Item>(count: number, read: (item: Struct) => Item): Item[] {
    return Array.from({ length: count }, () => read(this));
  }

  /** Skip to the next multiple of 8 bytes, where structures with 8-byte fields begin. */
  align(): void {
    this.next(0, 8);
  }

  private next(size: number, alignment: number): number {
    const start = Math.ceil(this.offset / alignment) * alignment;
    this.offset = start + size;
    return start;
  }
}
