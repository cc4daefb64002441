// A track of an open file: its values when they are asked for.

import type { OpenTrack, ReelInfo, TrackFields, TrackInfo, TrackValues } from "../types.js";
import { filled, requireFitting, requireNumber } from "./arguments.js";
import type { RemoteEngine } from "./remote_engine.js";

/** What a call may be given. */
export interface CallOptions {
  /** Takes the question back: the call then throws its reason, an `AbortError` by default. */
  signal?: AbortSignal;
}

/** What `ReelTrack.fields` may be given. */
export interface FieldsOptions extends CallOptions {
  /** The columns that are wanted. Default: all. */
  columns?: readonly number[];
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
   * unit of the track, in the array of its number type: `Float32Array`, `Uint8Array`, ...; integers
   * of 64 bits are bigints in a `BigInt64Array` or `BigUint64Array`. Numbers that are missing are NaN.
   *
   * @param number - From 0 on.
   * @param into - Is filled and returned where it is given.
   * @throws InvalidInputError where there is no such frame, or `into` is of another type or length.
   * @throws UnsupportedVersionError where the track is of a newer build.
   * @throws CorruptStreamError where the track or its block is damaged; all else can be decoded.
   * @throws SourceError where the bytes cannot be had.
   */
  async frame(
    number: number,
    into?: TrackValues,
    { signal }: CallOptions = {},
  ): Promise<TrackValues> {
    const { nItems, nColumns, numberType } = this.info;
    requireNumber("frame", number, this.reel.nFrames);
    requireFitting(into, numberType, nItems * nColumns);
    const engine = await this.engine();
    return filled(into, await engine.ask("frame", { track: 1 + this.number, number }, signal));
  }

  /**
   * A block of the track as small integers, for shaders.
   *
   * @param block - Number of the block in `info.blocks` of the file, from 0 on.
   * @throws InvalidInputError where an exact track has too many modes: more than 4 columns are asked
   *   for at once.
   * @throws InvalidInputError, UnsupportedVersionError, CorruptStreamError, SourceError as `frame`.
   */
  async fields(block: number, { signal, columns }: FieldsOptions = {}): Promise<TrackFields> {
    const { nColumns } = this.info;
    requireNumber("block", block, this.reel.blocks.length);
    for (const column of columns ?? []) requireNumber("column", column, nColumns);
    const engine = await this.engine();
    const wanted = columns ?? Array.from({ length: nColumns }, (_, column) => column);
    return engine.ask("fields", { track: 1 + this.number, block, columns: wanted }, signal);
  }
}
