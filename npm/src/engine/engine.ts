// Decodes a file and fetches the bytes that decoding needs.

import { type File, readFile } from "../core/file.js";
import { type Library, MissingBytes } from "../core/library.js";
import { readModes } from "../core/modes.js";
import { copyNumbers, bytesPerNumber } from "../core/numbers.js";
import { readSurface } from "../core/surface.js";
import { CorruptStreamError, SourceError } from "../errors.js";
import { type Fields, fieldsOfModes, sliceFrames, markMissing } from "../fields/mode_fields.js";
import { fieldsOfValues } from "../fields/value_fields.js";
import { type Piece, splitBlocks } from "../fields/pieces.js";
import type { ReelInfo, Surface, TrackFields, TrackValues } from "../types.js";
import { identifyOtherFormat } from "./other_formats.js";
import { type Range, Ranges } from "./ranges.js";

/** Reads the bytes `start` to `end - 1`, or fewer at the end of the file. */
export type Read = (start: number, end: number, signal: AbortSignal) => Promise<Uint8Array>;

/** Bytes read first: small files fit entirely, and of most others the connectivity. */
const HEAD_BYTES = 65536;

/** Bytes read from the end of the file: they contain the index of most files. */
const TAIL_BYTES = 4096;

/** Parameters of `Engine.open`. */
export interface OpenParameters {
  /** Size of the file in bytes; null if unknown. */
  readonly size: number | null;
  /** Whether any range can be read without reading all bytes before it. */
  readonly hasRanges: boolean;
  /** Limit of the memory that decoding may use, in bytes. */
  readonly memory: number;
  /** Segment to open; null if the file has only one. */
  readonly segment: number | null;
  /** Bytes that another engine has read from the same file. */
  readonly ranges?: readonly Range[];
}

/** Track index of the positions. */
export const POSITIONS = 0;

/** Decodes frames, and fields for shaders, of one file. */
export class Engine {
  readonly info: ReelInfo;
  private readonly pieces: readonly Piece[];
  private readonly decoder: number;
  private lastTrack = POSITIONS;
  private lastFrame = -1;
  /** Whether the last two requests were for consecutive frames of one track. */
  private isSequential = false;
  /** Whether the next block is being loaded. */
  private isPrefetching = false;

  private constructor(
    private readonly library: Library,
    private readonly read: Read,
    private readonly file: File,
    /** Bytes read to open the file. */
    private readonly openingBytes: Ranges,
    readonly surface: Surface,
  ) {
    this.pieces = splitBlocks(file);
    this.decoder = library.callForAddress((out, error) =>
      library.functions.meshreel_begin(file.handle, out, error),
    );
    const blocks = this.pieces.map(({ start, nFrames, sizeBytes }) => ({ start, nFrames, sizeBytes }));
    this.info = { ...file.info, tracks: file.tracks.slice(1).map(({ info }) => info), blocks };
  }

  /**
   * Open a file: read everything before the first block, and the index. If the index is missing or
   * damaged, read the whole file.
   *
   * @throws MeshReelError as `Library.check` and `read` do.
   */
  static async open(
    library: Library,
    read: Read,
    { size, hasRanges, memory, segment, ranges = [] }: OpenParameters,
    signal: AbortSignal,
  ): Promise<Engine> {
    const bytes = new Ranges(ranges);
    const fetch = async (start: number, end: number): Promise<Uint8Array> => {
      if (bytes.has(start, end)) return new Uint8Array();
      const range = await read(start, end, signal);
      bytes.add(start, range);
      return range;
    };
    const isLarge = size !== null && hasRanges && size > HEAD_BYTES;
    const parts = isLarge
      ? [fetch(0, HEAD_BYTES), fetch(size - TAIL_BYTES, size)]
      : [fetch(0, size ?? Number.MAX_SAFE_INTEGER)];
    const [head] = await Promise.all(parts);
    const sizeBytes = isLarge ? size : head.length || (size ?? 0);
    // Without an index, blocks are found section by section. Doubling the read-ahead each time keeps
    // the number of requests small.
    let readAhead = HEAD_BYTES;
    const readMore: Read = (start, end, abortSignal) => {
      const range = read(start, Math.min(end + readAhead, sizeBytes), abortSignal);
      readAhead *= 2;
      return range;
    };
    const attempt = <T>(work: () => T): Promise<T> =>
      fetchUntilDone(library, bytes, readMore, signal, work);
    const handle = await attempt(() => openFile(library, sizeBytes, memory, segment, head));
    const file = readFile(library, handle);
    const surface = await attempt(() => {
      library.check((error) => library.functions.meshreel_read_surface(handle, error));
      return readSurface(library, file);
    });
    const images = await attempt(() =>
      surface.images.map(({ start, end, ...named }) => ({ ...named, bytes: bytes.slice(start, end) })),
    );
    const keepsBytes = isLarge || sizeBytes <= HEAD_BYTES;
    return new Engine(library, read, file, keepsBytes ? bytes : new Ranges(), { ...surface, images });
  }

  /** Bytes read when the file was opened; empty if a large file was read as a whole. */
  ranges(): readonly Range[] {
    return this.openingBytes.list();
  }

  /** Decode a frame of a track, of shape (nItems, nColumns). Both indices must be valid. */
  async frame(track: number, number: number, signal: AbortSignal): Promise<TrackValues> {
    this.recordRequest(track, number, 1);
    return this.attempt(signal, () => this.decodeFrames(track, number, 1)[0]);
  }

  /** Decode columns of a track in a piece as fields for shaders. All indices must be valid. */
  async fields(
    track: number,
    piece: number,
    columns: readonly number[],
    signal: AbortSignal,
  ): Promise<TrackFields> {
    const { start, nFrames, block } = this.pieces[piece];
    // Players request the next block late, but the next piece of the same block early: only the
    // latter can drive prefetching.
    if (nFrames < this.file.blocks[block].nFrames) this.recordRequest(track, start, nFrames);
    const fields = await this.attempt(signal, () => this.decodeFields(track, piece, columns));
    return { ...fields, index: piece, start };
  }

  /**
   * Load the next block if frames are requested in order and the last one is in the second half of
   * its block. Failures are ignored here: requesting a frame of that block reports them.
   */
  async prefetch(): Promise<void> {
    const { blocks } = this.file;
    const current = this.blockOf(this.lastFrame);
    const { start, nFrames } = blocks[current];
    const isNear = 2 * this.lastFrame >= 2 * start + nFrames;
    if (!this.isSequential || !isNear || this.isPrefetching || current + 1 >= blocks.length) return;
    this.isPrefetching = true;
    const { library, decoder, lastTrack } = this;
    const load = (error: number): number =>
      library.functions.meshreel_load(decoder, lastTrack, current + 1, 0, error);
    await this.attempt(new AbortController().signal, () => library.check(load)).catch(() => {});
    this.isPrefetching = false;
  }

  private decodeFields(track: number, piece: number, columns: readonly number[]): Fields {
    const { library, decoder, file } = this;
    const { start, nFrames, block } = this.pieces[piece];
    const { nItems, nColumns } = file.tracks[track].info;
    const first = start - file.blocks[block].start;
    const modes = readModes(library, decoder, track, block, nItems);
    if (!modes) {
      const origin = track === POSITIONS ? file.info.center : undefined;
      return fieldsOfValues(this.decodeFrames(track, start, nFrames), nColumns, columns, origin);
    }
    const whole = fieldsOfModes(modes, columns);
    const part = nFrames < whole.nFrames ? sliceFrames(whole, first, nFrames) : whole;
    if (!modes.hasMissing) return part;
    const decodeFrames = this.decodeFrames(track, start, nFrames) as Float64Array[];
    return markMissing(part, (t, item, c) => Number.isNaN(decodeFrames[t][item * nColumns + columns[c]]));
  }

  /** Decode consecutive frames of one block. */
  private decodeFrames(track: number, first: number, count: number): TrackValues[] {
    const { library, decoder, file } = this;
    const { type, info } = file.tracks[track];
    const length = info.nItems * info.nColumns;
    const frameBytes = length * bytesPerNumber(type);
    return library.withMemory(count * frameBytes, (out) => {
      library.check((error) =>
        library.functions.meshreel_decode(decoder, track, first, count, 0, 0, out, error),
      );
      return Array.from({ length: count }, (_, t) =>
        copyNumbers(library.buffer, type, out + t * frameBytes, length),
      );
    });
  }

  private recordRequest(track: number, first: number, count: number): void {
    this.isSequential = track === this.lastTrack && first === this.lastFrame + 1;
    this.lastTrack = track;
    this.lastFrame = first + count - 1;
  }

  private blockOf(frame: number): number {
    return Math.max(0, this.file.blocks.findLastIndex(({ start }) => start <= frame));
  }

  private attempt<T>(signal: AbortSignal, work: () => T): Promise<T> {
    return fetchUntilDone(this.library, new Ranges(this.openingBytes.list()), this.read, signal, work);
  }
}

/** Repeat `work`, fetching missing bytes in between, until it succeeds; returns its result. */
async function fetchUntilDone<T>(
  library: Library,
  bytes: Ranges,
  read: Read,
  signal: AbortSignal,
  work: () => T,
): Promise<T> {
  for (;;) {
    signal.throwIfAborted();
    try {
      return library.withBytes(bytes, work);
    } catch (error) {
      if (!(error instanceof MissingBytes)) throw error;
      const [start, end] = bytes.missing(error.start, error.end) ?? [error.start, error.end];
      const range = await read(start, end, signal);
      if (range.length < end - start) {
        throw new SourceError(`the source returned only part of bytes ${start} to ${end}`);
      }
      bytes.add(start, range);
    }
  }
}

/** Open a file in the library; if it is not a `.reel` file, the error names its format. */
function openFile(
  library: Library,
  size: number,
  memory: number,
  segment: number | null,
  head: Uint8Array,
): number {
  try {
    return library.open(size, memory, segment);
  } catch (error) {
    const kind = error instanceof CorruptStreamError && identifyOtherFormat(head);
    throw kind ? new CorruptStreamError(`not a .reel file: ${kind}`) : error;
  }
}
