// A track of an open file that decodes values on request.

import type { OpenTrack, ReelInfo, TrackFields, TrackInfo, TrackValues } from "../types.js";
import { requireIndex, valuesIn } from "./arguments.js";
import type { RemoteEngine } from "./remote_engine.js";

/** Options of calls that decode. */
export interface CallOptions {
  /** Cancels the call, which then throws the reason of the signal: an `AbortError` by default. */
  signal?: AbortSignal;
}

/** Options of `ReelTrack.fields`. */
export interface FieldsOptions extends CallOptions {
  /** Columns to decode. Default: all. */
  columns?: readonly number[];
}

/**
 * A track of a `ReelFile`. Its last two decoded blocks are cached until the file is closed. Values
 * are bit-identical to those of the Python package.
 */
export class ReelTrack implements OpenTrack {
  readonly info: TrackInfo;

  /**
   * @param index - Index in `reel.tracks`.
   * @param segment - Segment of the file; may be null if there is only one.
   * @param engine - Starts, on the first call, the engine that decodes tracks.
   */
  constructor(
    private readonly reel: ReelInfo,
    private readonly index: number,
    private readonly segment: number | null,
    private readonly engine: () => Promise<RemoteEngine>,
  ) {
    this.info = reel.tracks[index];
  }

  /**
   * Decode the values of a frame, of shape (nItems, nColumns), in the unit of the track and in file
   * order. The array type matches `info.numberType`: `Float32Array`, `Uint8Array`, ...; 64-bit
   * integers are bigints in a `BigInt64Array` or `BigUint64Array`. Missing values are NaN.
   *
   * @param index - Frame, counted from 0.
   * @param target - An array to reuse, as in `ReelFile.frame`.
   * @throws InvalidInputError if there is no such frame, or `target` has another type or length.
   * @throws UnsupportedVersionError if the track needs a newer version.
   * @throws CorruptStreamError if the track or its block is damaged; the rest can be decoded.
   * @throws SourceError if the bytes cannot be read.
   */
  async frame(index: number, target?: TrackValues | null, { signal }: CallOptions = {}): Promise<TrackValues> {
    requireIndex("frame", index, this.reel.nFrames);
    const engine = await this.engine();
    const call = { segment: this.segment, track: 1 + this.index, frame: index };
    return valuesIn(target, await engine.call("frame", call, signal));
  }

  /**
   * Decode a block of the track to 16-bit fields and weights, for shaders.
   *
   * @param block - Index in `info.blocks` of the file.
   * @throws InvalidInputError if more than 4 columns of an exact track are requested at once.
   * @throws InvalidInputError, UnsupportedVersionError, CorruptStreamError, SourceError as `frame`.
   */
  async fields(block: number, { signal, columns }: FieldsOptions = {}): Promise<TrackFields> {
    const { nColumns } = this.info;
    requireIndex("block", block, this.reel.blocks.length);
    for (const column of columns ?? []) requireIndex("column", column, nColumns);
    const engine = await this.engine();
    const selected = columns ?? Array.from({ length: nColumns }, (_, column) => column);
    const call = { segment: this.segment, track: 1 + this.index, block, columns: selected };
    return engine.call("fields", call, signal);
  }
}
