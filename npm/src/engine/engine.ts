// Decodes a segment and fetches the bytes that decoding needs.

import { cutCells } from "../core/cells.js";
import { type File, readFile } from "../core/file.js";
import { type Library, MissingBytes } from "../core/library.js";
import { readModes } from "../core/modes.js";
import { copyNumbers, bytesPerNumber } from "../core/numbers.js";
import { readSurface, type StoredImage } from "../core/surface.js";
import { SourceError } from "../errors.js";
import { type Fields, fieldsOfModes, sliceFrames, markMissing } from "../fields/mode_fields.js";
import { fieldsOfValues } from "../fields/value_fields.js";
import { type Piece, splitBlocks } from "../fields/pieces.js";
import type {
  CellPolygons,
  Cells,
  CutPlane,
  Positions,
  ReelInfo,
  Surface,
  TrackFields,
  TrackValues,
} from "../types.js";
import { Ranges } from "./ranges.js";

/** Reads the bytes `start` to `end - 1`, or fewer at the end of the file. */
export type Read = (start: number, end: number, signal: AbortSignal) => Promise<Uint8Array>;

/** Track index of the positions. */
export const POSITIONS = 0;

/** Decodes frames, and fields for shaders, of a segment. */
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
  private isClosed = false;

  private constructor(
    private readonly library: Library,
    private readonly read: Read,
    private readonly file: File,
    /** Bytes read to open it. */
    private openingBytes: Ranges,
    readonly surface: Surface,
    private readonly images: readonly StoredImage[],
  ) {
    this.pieces = splitBlocks(file);
    this.decoder = library.callForAddress((out, error) =>
      library.functions.meshreel_begin(file.handle, out, error),
    );
    const blocks = this.pieces.map(({ start, nFrames, sizeBytes }) => ({ start, nFrames, sizeBytes }));
    this.info = { ...file.info, tracks: file.tracks.slice(1).map(({ info }) => info), blocks };
  }

  /**
   * Create the engine of a file with one segment, or of an open segment.
   *
   * @param bytes - Bytes that were read before; receives what is read here.
   * @param readMore - Reads bytes that are still missing.
   * @throws MeshReelError as `Library.check` and `read` do.
   */
  static async create(
    library: Library,
    handle: number,
    bytes: Ranges,
    read: Read,
    readMore: Read,
    signal: AbortSignal,
  ): Promise<Engine> {
    const attempt = <T>(work: () => T): Promise<T> =>
      fetchUntilDone(library, bytes, readMore, signal, work);
    const file = readFile(library, handle);
    const surface = await attempt(() => {
      library.check((error) => library.functions.meshreel_read_surface(handle, error));
      return readSurface(library, file);
    });
    const images = surface.images.map(({ start: _, ...image }) => image);
    return new Engine(library, read, file, bytes, { ...surface, images }, surface.images);
  }

  /** Release the bytes that were read to open it: they are read again on demand. */
  releaseBytes(): void {
    this.openingBytes = new Ranges();
  }

  /** Release the memory of the library. Calls that are waiting for bytes fail. */
  close(): void {
    this.isClosed = true;
    this.library.functions.meshreel_end(this.decoder);
    this.library.functions.meshreel_close(this.file.handle);
  }

  /** Decode a frame of a track, of shape (nItems, nColumns). Both indices must be valid. */
  async frame(track: number, number: number, signal: AbortSignal): Promise<TrackValues> {
    this.recordRequest(track, number, 1);
    return this.attempt(signal, () => this.decodeFrames(track, number, 1)[0]);
  }

  /** Read an image, and verify its checksum. The index must be valid. */
  async image(index: number, signal: AbortSignal): Promise<Uint8Array> {
    const { library, file } = this;
    const { start, sizeBytes } = this.images[index];
    return this.attempt(signal, (bytes) => {
      library.check((error) => library.functions.page_check_image(file.handle, index, error));
      return bytes.slice(start, start + sizeBytes);
    });
  }

  /** Return the polygons of the cells that are not beyond a plane in the first frame. */
  async cut(plane: CutPlane, signal: AbortSignal): Promise<CellPolygons> {
    const positions = (await this.frame(POSITIONS, 0, signal)) as Positions;
    return cutCells(this.library, this.surface.cells as Cells, positions, plane);
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

  private attempt<T>(signal: AbortSignal, work: (bytes: Ranges) => T): Promise<T> {
    const bytes = new Ranges(this.openingBytes.list());
    const attempted = (): T => {
      if (this.isClosed) throw new DOMException("the segment was closed", "AbortError");
      return work(bytes);
    };
    return fetchUntilDone(this.library, bytes, this.read, signal, attempted);
  }
}

/** Repeat `work`, fetching missing bytes in between, until it succeeds; returns its result. */
export async function fetchUntilDone<T>(
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
