// Bytes from front to back: small integers, numbers, texts.

import { CorruptStreamError, TruncatedStreamError } from "../errors.js";

const MAX_VARINT_BYTES = 9;
const UTF8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

/** Reads bytes one after another. */
export class ByteReader {
  private readonly view: DataView;

  /** @param position - Of the next byte that is read. */
  constructor(
    readonly bytes: Uint8Array,
    public position = 0,
  ) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  /** How many bytes are left. */
  get left(): number {
    return this.bytes.length - this.position;
  }

  /** All bytes that are left; they are a view. */
  rest(): Uint8Array {
    return this.bytes.subarray(this.position);
  }

  /**
   * An unsigned integer of 7 bits a byte; those above 2^53 are not exact.
   *
   * @throws TruncatedStreamError where the bytes end inside it.
   * @throws CorruptStreamError where it is longer than 9 bytes.
   */
  varint(): number {
    let value = 0;
    for (let k = 0; k < MAX_VARINT_BYTES; k++) {
      if (this.position + k >= this.bytes.length) {
        throw new TruncatedStreamError(`an integer at byte ${this.position} is cut off`);
      }
      const byte = this.bytes[this.position + k];
      value += (byte & 0x7f) * 2 ** (7 * k);
      if (byte < 0x80) {
        this.position += k + 1;
        return value;
      }
    }
    throw new CorruptStreamError(
      `the integer at byte ${this.position} is longer than ${MAX_VARINT_BYTES} bytes`,
    );
  }

  /**
   * So many bytes; they are a view.
   *
   * @param cutOff - What is said where they are not there.
   * @throws TruncatedStreamError where there are fewer.
   */
  take(length: number, cutOff: string): Uint8Array {
    if (length > this.left) throw new TruncatedStreamError(cutOff);
    this.position += length;
    return this.bytes.subarray(this.position - length, this.position);
  }

  /** A byte; throws as `take`. */
  byte(cutOff: string): number {
    return this.take(1, cutOff)[0];
  }

  /** A number of single precision; throws as `take`. */
  float32(cutOff: string): number {
    this.take(4, cutOff);
    return this.view.getFloat32(this.position - 4, true);
  }

  /** A number of double precision; throws as `take`. */
  float64(cutOff: string): number {
    this.take(8, cutOff);
    return this.view.getFloat64(this.position - 8, true);
  }

  /** An unsigned integer of four bytes; throws as `take`. */
  uint32(cutOff: string): number {
    this.take(4, cutOff);
    return this.view.getUint32(this.position - 4, true);
  }

  /**
   * A text with its length before it.
   *
   * @throws TruncatedStreamError where the bytes end inside it.
   * @throws CorruptStreamError where it is not UTF-8.
   */
  text(): string {
    const bytes = this.take(this.varint(), "a section ends inside a name");
    return decodedText(bytes, "a name is not UTF-8");
  }
}

/**
 * Text of bytes.
 *
 * @throws CorruptStreamError where they are not UTF-8.
 */
export function decodedText(bytes: Uint8Array, otherwise: string): string {
  try {
    return UTF8.decode(bytes);
  } catch {
    throw new CorruptStreamError(otherwise);
  }
}
