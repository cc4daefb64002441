// An open `.reel` file with any number of segments.

import { Mp4Part } from "../source/mp4.js";
import type { SourceInput } from "../source/transport.js";
import type { ByteSource, FileInfo, MeshFrame, OpenSegments, SegmentInfo } from "../types.js";
import { requireIndex } from "./arguments.js";
import { FileEngines, type FileOptions } from "./engines.js";
import { ReelFile } from "./reel_file.js";
import type { CallOptions } from "./reel_track.js";

/** Maximum number of segments whose surfaces stay in memory, as in the worker. */
const MAX_SEGMENTS = 4;

/**
 * An open `.reel` file with any number of segments: meshes of different connectivity, played in
 * order. Frames are numbered across all segments.
 *
 * Opening reads the index and the first segment; others are read when they are needed. The most
 * recently used segments stay open in the worker.
 *
 * @example
 * const file = await SegmentedReelFile.open("capture.reel");
 * const { segment, positions, triangles } = await file.frame(120);
 * const reel = await file.segment(segment); // surface, tracks and blocks of the segment
 * file.close();
 */
export class SegmentedReelFile implements OpenSegments {
  readonly #engines: FileEngines;
  /** Open segments, most recently used last. */
  readonly #opened: Map<number, ReelFile>;
  /** The first segment; stays in memory. */
  readonly first: ReelFile;

  private constructor(
    engines: FileEngines,
    /** Metadata that all segments share. */
    readonly info: FileInfo,
    readonly segments: readonly SegmentInfo[],
    first: ReelFile,
  ) {
    this.#engines = engines;
    this.first = first;
    this.#opened = new Map([[0, first]]);
  }

  /**
   * Open a file with one or more segments.
   *
   * @param from - As for `ReelFile.open`; or a source, which is closed with the file.
   * @throws like `ReelFile.open`, also if the first segment is damaged.
   */
  static async open(from: SourceInput | Promise<ByteSource>, options: FileOptions = {}): Promise<SegmentedReelFile> {
    const { engines, opened } = await FileEngines.open(from, options, 0);
    const segments = await engines.positions.call("segments", {}, options.signal).catch((error: unknown) => {
      engines.close();
      throw error;
    });
    const first = ReelFile.segment(engines, 0, opened);
    return new SegmentedReelFile(engines, opened.file, segments, first);
  }

  /**
   * Open a segment. Its frames are counted from 0, and its `close` has no effect.
   *
   * @throws InvalidInputError if there is no such segment.
   * @throws CorruptStreamError if it is damaged; others can be decoded.
   * @throws SourceError if the bytes cannot be read.
   */
  async segment(index: number, { signal }: CallOptions = {}): Promise<ReelFile> {
    requireIndex("segment", index, this.segments.length);
    const opened = this.#opened;
    const reel =
      opened.get(index) ??
      ReelFile.segment(this.#engines, index, await this.#engines.openSegment(index, signal));
    opened.delete(index);
    opened.set(index, reel);
    if (opened.size > MAX_SEGMENTS) opened.delete([...opened.keys()][0]);
    return reel;
  }

  /**
   * Decode a frame: its segment, positions and triangles.
   *
   * @param index - Frame, counted from 0 across all segments.
   * @throws InvalidInputError if there is no such frame.
   * @throws CorruptStreamError, SourceError as `segment`
   */
  async frame(index: number, options: CallOptions = {}): Promise<MeshFrame> {
    requireIndex("frame", index, this.info.nFrames);
    const segment = this.segments.findLastIndex(({ start }) => start <= index);
    const reel = await this.segment(segment, options);
    const positions = await reel.frame(index - this.segments[segment].start, null, options);
    return { segment, positions, triangles: reel.surface.triangles };
  }

  /** Whether it is an MP4 file: its video is the texture. */
  get isInMp4(): boolean {
    return this.#engines.source instanceof Mp4Part;
  }

  /** Whether a worker decodes frames, rather than the calling thread. */
  get isInWorker(): boolean {
    return this.#engines.positions.isInWorker;
  }

  /** Release all memory and connections. Pending calls throw an `AbortError`. */
  close(): void {
    this.#engines.close();
  }
}
