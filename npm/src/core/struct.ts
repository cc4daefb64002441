// Structures of include/meshreel.h in the memory of the library.

const text = new TextDecoder();

/** Reads the fields of a structure in order, each where a C compiler for WebAssembly puts it. */
export class Struct {
  private readonly view: DataView;

  /** @param at - Address of the next field. */
  constructor(
    readonly buffer: ArrayBuffer,
    private at: number,
  ) {
    this.view = new DataView(buffer);
  }

  uint32(): number {
    return this.view.getUint32(this.next(4, 4), true);
  }

  int32(): number {
    return this.view.getInt32(this.next(4, 4), true);
  }

  float64(): number {
    return this.view.getFloat64(this.next(8, 8), true);
  }

  /** A `uint64_t`, which is less than 2^53 or UINT64_MAX. */
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

  /** A string that ends with a byte of 0. */
  message(): string {
    const bytes = new Uint8Array(this.buffer, this.uint32());
    return text.decode(bytes.subarray(0, bytes.indexOf(0)));
  }

  /** Structures that follow one another. */
  each<Found>(count: number, read: (one: Struct) => Found): Found[] {
    return Array.from({ length: count }, () => read(this));
  }

  /** Go on where a field of 8 bytes may begin, as structures with such fields do. */
  align(): void {
    this.next(0, 8);
  }

  private next(size: number, alignment: number): number {
    const start = Math.ceil(this.at / alignment) * alignment;
    this.at = start + size;
    return start;
  }
}
