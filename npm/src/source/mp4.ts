// Finds a `.reel` in an MP4 file: docs/format.md describes its box.

import { CorruptStreamError } from "../errors.js";
import type { ByteSource } from "../types.js";

const [FTYP, UUID, REEL] = [0x66747970, 0x75756964, [0x852cfece71bb4975n, 0xbbc069f5c19c07a3n]];
const MAX_BOXES = 64;

/** The `.reel` in an MP4 file. */
export class Mp4Part implements ByteSource {
  /** @param end - position of its last byte in the file, plus 1; null if unknown */
  constructor(
    private readonly file: ByteSource,
    private readonly start: number,
    private readonly end: number | null,
  ) {}

  get size(): number | null {
    return this.end && this.end - this.start;
  }

  get hasRanges(): boolean {
    return this.file.hasRanges;
  }

  read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array> {
    const clamp = (position: number) => Math.min(this.start + position, this.end ?? Number.MAX_SAFE_INTEGER);
    return this.file.read(clamp(start), clamp(end), signal);
  }

  close(): void {
    this.file.close();
  }
}

/**
 * Return the `.reel` in a source, which may be one itself.
 *
 * @throws CorruptStreamError if none of the first boxes of an MP4 file contains one, or one is damaged.
 */
export async function findReel(source: ByteSource, signal?: AbortSignal): Promise<ByteSource> {
  for (let i = 0, start = 0; i < MAX_BOXES; i++) {
    const bytes = new Uint8Array(32); // zeros follow the end of the file
    bytes.set(await source.read(start, start + 32, signal));
    const fields = new DataView(bytes.buffer);
    const type = fields.getUint32(4);
    if (!start && type !== FTYP) return source;
    let [size, nHead] = [fields.getUint32(0), 8];
    if (size === 1) [size, nHead] = [Number(fields.getBigUint64(8)) || 1, 16];
    if (!size && !type) break; // the end
    const end = size ? start + size : source.size;
    if ((size && size < nHead) || (end ?? 0) > (source.size ?? Number.MAX_SAFE_INTEGER)) {
      throw new CorruptStreamError(`a box at byte ${start} of the MP4 file exceeds it; fetch the file again`);
    }
    if (type === UUID && REEL.every((part, k) => fields.getBigUint64(nHead + 8 * k) === part)) {
      return new Mp4Part(source, start + nHead + 16, end && Math.max(end, start + nHead + 16));
    }
    if (!size) break;
    start += size;
  }
  throw new CorruptStreamError(
    "this MP4 file contains no .reel; `meshreel register --texture` writes files with both",
  );
}
