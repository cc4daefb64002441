// Opens a file and its segments.

import { readSegments, type StoredSegment } from "../core/file.js";
import type { Library } from "../core/library.js";
import { CorruptStreamError, InvalidInputError } from "../errors.js";
import type { FileInfo } from "../types.js";
import { Engine, fetchUntilDone, type Read } from "./engine.js";
import { identifyOtherFormat } from "./other_formats.js";
import { type Range, Ranges } from "./ranges.js";

/** Bytes read first: small files fit entirely, and of most others the connectivity. */
const HEAD_BYTES = 65536;

/** The first 8 bytes of a file. */
const MAGIC = 0x89_52_45_45_4c_0d_0a_1an;

/** Bytes read from the end of the file: they contain the index of most files. */
const TAIL_BYTES = 4096;

/** Segments that stay open: enough to play across a boundary, and to go back. */
const MAX_OPEN_SEGMENTS = 4;

/** Parameters of `SegmentsEngine.open`. */
export interface OpenParameters {
  /** Size of the file in bytes; null if unknown. */
  readonly size: number | null;
  /** Whether any range can be read without reading all bytes before it. */
  readonly hasRanges: boolean;
  /** Limit of the memory that decoding may use, in bytes. */
  readonly memory: number;
}

/** An open file. Segments are opened on request; those used last stay open. */
export class SegmentsEngine {
  readonly info: FileInfo;
  readonly segments: readonly StoredSegment[];
  /** Open segments, the one used last at the end. */
  private readonly engines = new Map<number, Engine>();

  private constructor(
    private readonly library: Library,
    private readonly handle: number,
    private bytes: Ranges,
    private readonly read: Read,
    private readonly readMore: Read,
    /** Whether to keep the bytes read to open the file: false if a large file was read whole. */
    private readonly keepsBytes: boolean,
  ) {
    ({ info: this.info, segments: this.segments } = readSegments(library, handle));
  }

  /**
   * Open a file: read its first bytes, and the index. If the index is missing or damaged, read the
   * whole file.
   *
   * @param bytes - Bytes already read; newly read bytes are added.
   * @throws MeshReelError as `Library.check` and `read` do.
   */
  static async open(
    library: Library,
    bytes: Ranges,
    read: Read,
    { size, hasRanges, memory }: OpenParameters,
    signal: AbortSignal,
  ): Promise<SegmentsEngine> {
    const fetch = async (start: number, end: number): Promise<void> => {
      if (!bytes.has(start, end)) bytes.add(start, await read(start, end, signal));
    };
    const isLarge = size !== null && hasRanges && size > HEAD_BYTES;
    if (isLarge) await Promise.all([fetch(0, HEAD_BYTES), fetch(size - TAIL_BYTES, size)]);
    else if (!bytes.has(0, 1)) {
      await fetch(0, Math.min(HEAD_BYTES, size ?? HEAD_BYTES));
      // The rest of anything else is not read: an endless body would fill the memory.
      const isReel =
        bytes.has(0, HEAD_BYTES) && new DataView(bytes.slice(0, 8).buffer).getBigUint64(0) === MAGIC;
      if (isReel) await fetch(HEAD_BYTES, size ?? Number.MAX_SAFE_INTEGER);
    }
    const [nRead] = bytes.missing(0, Number.MAX_SAFE_INTEGER)!;
    const sizeBytes = isLarge ? size : nRead || (size ?? 0);
    const readMore = readAhead(read, sizeBytes);
    const handle = await fetchUntilDone(library, bytes, readMore, signal, () =>
      openFile(library, sizeBytes, memory, bytes),
    );
    const keepsBytes = isLarge || sizeBytes <= HEAD_BYTES;
    return new SegmentsEngine(library, handle, bytes, read, readMore, keepsBytes);
  }

  /** Bytes read when the file was opened; empty if a large file was read as a whole. */
  ranges(): readonly Range[] {
    return this.bytes.list();
  }

  /**
   * Return the engine of a segment.
   *
   * @param number - Index of the segment; null is allowed if there is only one.
   * @throws InvalidInputError if there is no such segment.
   * @throws MeshReelError as `Library.check` and `read` do.
   */
  async segment(number: number | null, signal: AbortSignal): Promise<Engine> {
    const count = this.segments.length;
    const index = number ?? 0;
    if (index >= count || (number === null && count > 1)) {
      throw new InvalidInputError(
        `the file has ${count} segments; open one of them: segment 0 to ${count - 1}`,
      );
    }
    const opened = this.engines.get(index) ?? (await this.openSegment(index, signal));
    const engine = this.engines.get(index) ?? opened;
    if (opened !== engine) opened.close(); // a concurrent call was faster
    this.engines.delete(index);
    this.engines.set(index, engine);
    const [oldest] = this.engines;
    if (this.engines.size > MAX_OPEN_SEGMENTS) {
      this.engines.delete(oldest[0]);
      oldest[1].close();
    }
    return engine;
  }

  private async openSegment(index: number, signal: AbortSignal): Promise<Engine> {
    const { library, read, readMore } = this;
    if (this.segments.length === 1) {
      const engine = await Engine.create(library, this.handle, this.bytes, read, readMore, signal);
      if (!this.keepsBytes) {
        this.bytes = new Ranges();
        engine.releaseBytes();
      }
      return engine;
    }
    const { offset, sizeBytes } = this.segments[index];
    const bytes = new Ranges(this.bytes.list());
    const gap = bytes.missing(offset, offset + Math.min(sizeBytes, HEAD_BYTES));
    if (gap) bytes.add(gap[0], await read(...gap, signal));
    const readOn = readAhead(read, offset + sizeBytes);
    const handle = await fetchUntilDone(library, bytes, readOn, signal, () =>
      library.callForAddress((out, error) =>
        library.functions.meshreel_open_segment(this.handle, index, out, error),
      ),
    );
    try {
      return await Engine.create(library, handle, bytes, read, readOn, signal);
    } catch (error) {
      library.functions.meshreel_close(handle);
      throw error;
    }
  }
}

/**
 * Return a `read` that also reads the bytes behind a range, twice as many each time: without an index,
 * blocks are found section by section, and this keeps the number of requests small.
 */
function readAhead(read: Read, sizeBytes: number): Read {
  let nAhead = HEAD_BYTES;
  return (start, end, signal) => {
    const range = read(start, Math.min(end + nAhead, sizeBytes), signal);
    nAhead *= 2;
    return range;
  };
}

/** Open a file in the library; if it is not a `.reel` file, the error names its format. */
function openFile(library: Library, size: number, memory: number, bytes: Ranges): number {
  try {
    return library.open(size, memory);
  } catch (error) {
    const head = bytes.slice(0, Math.min(size, 64));
    const kind = error instanceof CorruptStreamError && identifyOtherFormat(head);
    throw kind ? new CorruptStreamError(`not a .reel file: ${kind}`) : error;
  }
}
