// A track of an open file: its values when they are asked for.

import type { Positions } from "../decode/frames.js";
import type { OpenTrack, ReelInfo, TrackFields, TrackInfo } from "../types.js";
import { filled, requireFitting, requireNumber } from "./arguments.js";
import type { RemoteEngine } from "./remote_engine.js";

/** What a call may be given. */
export interface CallOptions {
  /** Takes the question back: the call then throws its reason, an `AbortError` by default. */
  signal?: AbortSignal;
}

/**
 * A track of a `ReelFile`. Two decoded blocks of it are kept, until the file is closed. Values are the
 * same bits as those of the Python package.
 */
export class ReelTrack implements OpenTrack {
  /** Facts of the track. */
  readonly info: TrackInfo;

  /**
   * @param reel - Facts of the file.
   * @param number - Of the track, from 0 on.
   * @param engine - What decodes tracks.
   */
  constructor(
    private readonly reel: ReelInfo,
    private readonly number: number,
    private readonly engine: () => Promise<RemoteEngine>,
  ) {
    this.info = reel.tracks[number];
  }

  /**
   * Values of a frame, of shape (nItems, nColumns): vertices, faces or corners in their order, in the
   * unit of the track; float32 or float64, as in the file.
   *
   * @param number - From 0 on.
   * @param into - Is filled and returned where it is given.
   * @throws InvalidInputError where there is no such frame, or `into` is of another type or length.
   * @throws UnsupportedVersionError where the track is of a newer build.
   * @throws CorruptStreamError where the track or its block is damaged; all else can be decoded.
   * @throws SourceError where the bytes cannot be had.
   */
  async frame(number: number, into?: Positions, { signal }: CallOptions = {}): Promise<Positions> {
    const { nItems, nColumns, numberType } = this.info;
    requireNumber("frame", number, this.reel.nFrames);
    requireFitting(into, numberType, nItems * nColumns);
    const engine = await this.engine();
    return filled(into, await engine.ask("values", { track: this.number, number }, signal));
  }

  /**
   * A block of the track as small integers, for shaders.
   *
   * @param block - Number of the block, from 0 on.
   * @throws InvalidInputError, UnsupportedVersionError, CorruptStreamError, SourceError as `frame`.
   */
  async fields(block: number, { signal }: CallOptions = {}): Promise<TrackFields> {
    requireNumber("block", block, this.reel.blocks.length);
    const engine = await this.engine();
    return engine.ask("trackFields", { track: this.number, block }, signal);
  }
}
