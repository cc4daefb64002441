// Byte source of a blob.

import { InvalidInputError, SourceError } from "../errors.js";
import type { ByteSource } from "../types.js";
import { errorReason } from "./transport.js";

/** A blob, such as bytes in memory, or a selected or dropped file. */
export class BlobSource implements ByteSource {
  readonly hasRanges = true;

  constructor(
    private readonly blob: Blob,
    private readonly name = (blob as Partial<File>).name ?? "the file",
  ) {}

  get size(): number {
    return this.blob.size;
  }

  async read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array> {
    signal?.throwIfAborted();
    const slice = this.blob.slice(...clampRange(start, end, this.size));
    const buffer = await slice.arrayBuffer().catch((error: unknown) => {
      throw new SourceError(
        `${this.name} cannot be read (${errorReason(error)}); if it has changed, open it again`,
        { cause: error },
      );
    });
    signal?.throwIfAborted();
    return new Uint8Array(buffer);
  }

  close(): void {}
}

/**
 * Clamp the range of a read to the size.
 *
 * @throws InvalidInputError if the range is invalid.
 */
export function clampRange(start: number, end: number, size: number | null): [number, number] {
  if (!(Number.isSafeInteger(start) && Number.isSafeInteger(end) && 0 <= start && start <= end)) {
    throw new InvalidInputError(`bytes ${start} to ${end} are no range; 0 <= start <= end must hold`);
  }
  return [Math.min(start, size ?? start), Math.min(end, size ?? end)];
}
