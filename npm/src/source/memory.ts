// Bytes that are here already.

import { InvalidInputError, SourceError } from "../errors.js";
import type { ByteSource } from "../types.js";
import { reasonOf } from "./server.js";

/** Bytes in memory. What is read is a copy, which a worker may take over. */
export class MemorySource implements ByteSource {
  readonly hasRanges = true;

  constructor(private readonly bytes: Uint8Array) {}

  get size(): number {
    return this.bytes.length;
  }

  async read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array> {
    signal?.throwIfAborted();
    // Not `slice`: that of a Buffer, the Uint8Array of Node, copies nothing.
    return new Uint8Array(this.bytes.subarray(...checkedRange(start, end, this.size)));
  }

  close(): void {}
}

/** A blob, such as a file that was chosen or dropped. */
export class BlobSource implements ByteSource {
  readonly hasRanges = true;

  constructor(private readonly blob: Blob) {}

  get size(): number {
    return this.blob.size;
  }

  async read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array> {
    signal?.throwIfAborted();
    const slice = this.blob.slice(...checkedRange(start, end, this.size));
    const buffer = await slice.arrayBuffer().catch((error: unknown) => {
      const { name = "the file" } = this.blob as Partial<File>;
      throw new SourceError(
        `${name} cannot be read (${reasonOf(error)}); if it has changed since, choose it again`,
        { cause: error },
      );
    });
    signal?.throwIfAborted();
    return new Uint8Array(buffer);
  }

  close(): void {}
}

/**
 * The positions of a read, both at most the size.
 *
 * @throws InvalidInputError where they are none.
 */
export function checkedRange(start: number, end: number, size: number | null): [number, number] {
  if (!(Number.isSafeInteger(start) && Number.isSafeInteger(end) && 0 <= start && start <= end)) {
    throw new InvalidInputError(`bytes ${start} to ${end} cannot be read; give 0 <= start <= end`);
  }
  return [Math.min(start, size ?? start), Math.min(end, size ?? end)];
}
