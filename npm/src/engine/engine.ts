// Decodes a file, fetching the bytes that it needs.

import { type File, readFile } from "../core/file.js";
import { type Library, MissingBytes } from "../core/library.js";
import { readModes } from "../core/modes.js";
import { numbersAt, sizeOf } from "../core/numbers.js";
import { readSurface } from "../core/surface.js";
import { CorruptStreamError, SourceError } from "../errors.js";
import { type Fields, fieldsOfModes, partOf, withMissing } from "../fields/of_modes.js";
import { fieldsOfValues } from "../fields/of_values.js";
import { type Piece, piecesOf } from "../fields/pieces.js";
import type { ReelInfo, Surface, TrackFields, TrackValues } from "../types.js";
import { foreignKind } from "./foreign.js";
import { type Range, Ranges } from "./ranges.js";

/** The bytes `start` to `end - 1`, fewer where there are no more. */
export type Read = (start: number, end: number, signal: AbortSignal) => Promise<Uint8Array>;

/** Bytes read first: they contain the connectivity of most files, and all of small ones. */
const HEAD_BYTES = 65536;

/** Bytes read from the end: they contain the index of most files. */
const TAIL_BYTES = 4096;

/** How a file is opened. */
export interface Opening {
  /** Bytes of the file, null if that is not known. */
  readonly size: number | null;
  /** Whether the end can be read before the rest. */
  readonly hasRanges: boolean;
  /** Bytes that decoding may take at once. */
  readonly memory: number;
  /** The one to open of a file of several segments. */
  readonly segment: number | null;
  /** What another engine of the same file has read. */
  readonly ranges?: readonly Range[];
}

/** Number of the positions among tracks. */
export const POSITIONS = 0;

export class Engine {
  readonly info: ReelInfo;
  private readonly pieces: readonly Piece[];
  private readonly decoder: number;
  private lastTrack = POSITIONS;
  private lastFrame = -1;
  /** Whether the last frames were requested in order. */
  private isPlayed = false;
  /** Whether the next block is being loaded. */
  private isAhead = false;

  private constructor(
    private readonly library: Library,
    private readonly read: Read,
    private readonly file: File,
    /** Bytes read to open the file. */
    private readonly opened: Ranges,
    readonly surface: Surface,
  ) {
    this.pieces = piecesOf(file);
    this.decoder = library.addressOf((found, error) =>
      library.functions.meshreel_begin(file.handle, found, error),
    );
    const blocks = this.pieces.map(({ start, nFrames, sizeBytes }) => ({ start, nFrames, sizeBytes }));
    this.info = { ...file.info, tracks: file.tracks.slice(1).map(({ info }) => info), blocks };
  }

  /**
   * Open a file: read everything before the first block, and the index. If the index is missing or
   * damaged, read the whole file.
   *
   * @throws MeshReelError as `Library.check`, or as reading does.
   */
  static async open(
    library: Library,
    read: Read,
    { size, hasRanges, memory, segment, ranges = [] }: Opening,
    signal: AbortSignal,
  ): Promise<Engine> {
    const bytes = new Ranges(ranges);
    const fetch = async (start: number, end: number): Promise<Uint8Array> => {
      if (bytes.has(start, end)) return new Uint8Array();
      const found = await read(start, end, signal);
      bytes.add(start, found);
      return found;
    };
    const isLarge = size !== null && hasRanges && size > HEAD_BYTES;
    const parts = isLarge
      ? [fetch(0, HEAD_BYTES), fetch(size - TAIL_BYTES, size)]
      : [fetch(0, size ?? Number.MAX_SAFE_INTEGER)];
    const [head] = await Promise.all(parts);
    const sizeBytes = isLarge ? size : head.length || (size ?? 0);
    // Each read goes twice as far ahead as the one before: without an index, blocks are found section
    // by section, and few reads have to do.
    let ahead = HEAD_BYTES;
    const readMore: Read = (start, end, ending) => {
      const found = read(start, Math.min(end + ahead, sizeBytes), ending);
      ahead *= 2;
      return found;
    };
    const attempt = <T>(work: () => T): Promise<T> =>
      attempted(library, bytes, readMore, signal, work);
    const handle = await attempt(() => openedFile(library, sizeBytes, memory, segment, head));
    const file = readFile(library, handle);
    const surface = await attempt(() => {
      library.check((error) => library.functions.meshreel_read_surface(handle, error));
      return readSurface(library, file);
    });
    const images = await attempt(() =>
      surface.images.map(({ start, end, ...named }) => ({ ...named, bytes: bytes.slice(start, end) })),
    );
    const isKept = isLarge || sizeBytes <= HEAD_BYTES;
    return new Engine(library, read, file, isKept ? bytes : new Ranges(), { ...surface, images });
  }

  /** Bytes read to open the file; none of a large file that was read as a whole. */
  ranges(): readonly Range[] {
    return this.opened.list();
  }

  /** Values of a frame of a track, of shape (N, C). Both must exist. */
  async frame(track: number, number: number, signal: AbortSignal): Promise<TrackValues> {
    this.note(track, number, 1);
    return this.attempt(signal, () => this.frames(track, number, 1)[0]);
  }

  /** Columns of a track in a piece, for shaders. All must exist. */
  async fields(
    track: number,
    piece: number,
    columns: readonly number[],
    signal: AbortSignal,
  ): Promise<TrackFields> {
    const { start, nFrames, block } = this.pieces[piece];
    // Pages request the next block late, but the next part of a block early.
    if (nFrames < this.file.blocks[block].nFrames) this.note(track, start, nFrames);
    const found = await this.attempt(signal, () => this.fieldsOf(track, piece, columns));
    return { ...found, number: piece, start };
  }

  /**
   * Load the next block, if frames are requested in order and the last one is in the second half of
   * its block. A failure is reported when a frame of that block is requested.
   */
  async goAhead(): Promise<void> {
    const { blocks } = this.file;
    const current = this.blockOf(this.lastFrame);
    const { start, nFrames } = blocks[current];
    const isNear = 2 * this.lastFrame >= 2 * start + nFrames;
    if (!this.isPlayed || !isNear || this.isAhead || current + 1 >= blocks.length) return;
    this.isAhead = true;
    const { library, decoder, lastTrack } = this;
    const load = (error: number): number =>
      library.functions.meshreel_load(decoder, lastTrack, current + 1, 0, error);
    await this.attempt(new AbortController().signal, () => library.check(load)).catch(() => {});
    this.isAhead = false;
  }

  private fieldsOf(track: number, piece: number, columns: readonly number[]): Fields {
    const { library, decoder, file } = this;
    const { start, nFrames, block } = this.pieces[piece];
    const { nItems, nColumns } = file.tracks[track].info;
    const first = start - file.blocks[block].start;
    const modes = readModes(library, decoder, track, block, nItems);
    if (!modes) {
      const origin = track === POSITIONS ? file.info.center : undefined;
      return fieldsOfValues(this.frames(track, start, nFrames), nColumns, columns, origin);
    }
    const whole = fieldsOfModes(modes, columns);
    const part = nFrames < whole.nFrames ? partOf(whole, first, nFrames) : whole;
    if (!modes.hasMissing) return part;
    const frames = this.frames(track, start, nFrames) as Float64Array[];
    return withMissing(part, (t, item, c) => Number.isNaN(frames[t][item * nColumns + columns[c]]));
  }

  /** Values of frames that lie in one block. */
  private frames(track: number, first: number, count: number): TrackValues[] {
    const { library, decoder, file } = this;
    const { type, info } = file.tracks[track];
    const length = info.nItems * info.nColumns;
    const frameBytes = length * sizeOf(type);
    return library.during(count * frameBytes, (out) => {
      library.check((error) =>
        library.functions.meshreel_decode(decoder, track, first, count, 0, 0, out, error),
      );
      return Array.from({ length: count }, (_, t) =>
        numbersAt(library.buffer, type, out + t * frameBytes, length),
      );
    });
  }

  private note(track: number, first: number, count: number): void {
    this.isPlayed = track === this.lastTrack && first === this.lastFrame + 1;
    this.lastTrack = track;
    this.lastFrame = first + count - 1;
  }

  private blockOf(frame: number): number {
    return Math.max(0, this.file.blocks.findLastIndex(({ start }) => start <= frame));
  }

  private attempt<T>(signal: AbortSignal, work: () => T): Promise<T> {
    return attempted(this.library, new Ranges(this.opened.list()), this.read, signal, work);
  }
}

/** Call `work` until all bytes that it needs have been fetched; returns its result. */
async function attempted<T>(
  library: Library,
  bytes: Ranges,
  read: Read,
  signal: AbortSignal,
  work: () => T,
): Promise<T> {
  for (;;) {
    signal.throwIfAborted();
    try {
      return library.reading(bytes, work);
    } catch (error) {
      if (!(error instanceof MissingBytes)) throw error;
      const [start, end] = bytes.missing(error.start, error.end) ?? [error.start, error.end];
      const found = await read(start, end, signal);
      if (found.length < end - start) {
        throw new SourceError(`bytes ${start} to ${end} of the file did not come whole`);
      }
      bytes.add(start, found);
    }
  }
}

/** Open a file in the library; the error names the kind of a file that is no `.reel`. */
function openedFile(
  library: Library,
  size: number,
  memory: number,
  segment: number | null,
  head: Uint8Array,
): number {
  try {
    return library.open(size, memory, segment);
  } catch (error) {
    const kind = error instanceof CorruptStreamError && foreignKind(head);
    throw kind ? new CorruptStreamError(`not a .reel stream: ${kind}`) : error;
  }
}
