// Playback: decides which picture is shown when, and dispatches events. Independent of rendering.

import { InvalidInputError } from "../errors.js";
import type { OpenReel, OpenSegments } from "../types.js";
import { BlockCache, type CachedBlock, MAX_BLOCKS } from "./block_cache.js";
import { Clock, type ClockSettings, type FrameRange } from "./clock.js";
import type { LoadedBlock, Moment } from "./loaded_block.js";

/** Frames per second if the file does not define them. */
export const DEFAULT_FPS = 24;

/** Events of playback. Blocks are indices in `info.blocks` of their segment. */
export interface PlaybackEvents {
  /** Another picture is shown: its frame, and the time in seconds. */
  frame: { frame: number; time: number };
  /** Playback passed the end and continues. */
  loop: object;
  /** Playback reached the end and stopped. */
  ended: object;
  /**
   * Playback waits for a block, or for the video of the texture (then the block is null). The time
   * and the picture do not change meanwhile.
   */
  waiting: { block: number | null };
  /** Playback starts, or resumes after waiting. */
  playing: object;
  /** Frames were loaded, or evicted; see `ReelMesh.buffered`. */
  progress: object;
  /**
   * A block cannot be loaded, or a texture cannot be shown (then the block is null). `frames` are the
   * frames that are missing. `track` is the track that cannot be loaded; without it, the positions
   * cannot.
   */
  error: { error: Error; block: number | null; frames?: FrameRange; track?: string };
  /** Playback differs from the request, such as when the video is longer than the mesh. */
  warning: { message: string };
}

/** An event of `PlaybackEvents` with its type. */
export type PlaybackEvent = {
  [Type in keyof PlaybackEvents]: { type: Type } & PlaybackEvents[Type];
}[keyof PlaybackEvents];

/** A block in the order of playback, or a segment that is not open, whose block is null. */
interface PlayedBlock extends FrameRange, CachedBlock {
  readonly segment: number;
  readonly block: number | null;
}

/** Loads blocks and displays pictures. */
export interface Display {
  /** Load a block, which pictures may use until it is released. */
  load(segment: number, block: number, signal: AbortSignal): Promise<LoadedBlock>;
  release(segment: number, block: LoadedBlock): void;
  show(segment: number, moment: Moment): void;
}

/** Drives the time in place of the clock: a video that the mesh follows. */
export interface MasterClock {
  /**
   * State of its picture at the current time: not available yet, captured, or past the last frame.
   * Captured pictures belong to the position of the clock.
   */
  readonly picture: "pending" | "captured" | "over";
  /** Show the captured picture; returns false if it is shown already. */
  show(): boolean;
  play(): void;
  pause(): void;
  /** Seek to a position in frames; the picture becomes pending. */
  seek(position: number): void;
  /** Adopt settings. @throws InvalidInputError if it does not support them. */
  change(settings: Partial<ClockSettings>): void;
  /** Pause while the mesh is not loaded, and resume afterwards. */
  setBlocked(isHeld: boolean): void;
  /** Called before each redraw of the page. */
  update(): void;
}

/** Plays the blocks of a file on a display. */
export class Playback {
  readonly #display: Display;
  readonly #send: (event: PlaybackEvent) => void;
  readonly clock: Clock;
  readonly #file: OpenSegments;
  /** Number of frames of the file. */
  readonly nFrames: number;
  /** Whether to interpolate between frames. */
  isInterpolating = true;
  /** Whether it plays, or will once it no longer waits. */
  isPlaying = false;
  /** Whether the picture at the current time is not available yet. */
  isWaiting = true;
  readonly #cache: BlockCache<PlayedBlock>;
  /** In order; a segment becomes its first block when it is opened, and the others follow. */
  readonly #blocks: PlayedBlock[];
  #masterClock: MasterClock | null = null;
  #hasDisplay = false;
  /** Position of the shown picture. */
  #shown: number | null = null;

  /** @throws InvalidInputError if the file has no frames. */
  constructor(file: OpenSegments, display: Display, send: (event: PlaybackEvent) => void) {
    this.#display = display;
    this.#send = send;
    this.#file = file;
    this.#blocks = file.segments.flatMap(({ start, nFrames }, segment) =>
      segment ? playedBlock(segment, null, start, nFrames) : playedBlocks(file.first, segment, start),
    );
    const end = this.#blocks.at(-1);
    if (!end) throw new InvalidInputError(`the file ${file.info.name} has no frames`);
    this.nFrames = end.start + end.nFrames;
    this.clock = new Clock(this.nFrames, file.info.fps || DEFAULT_FPS, file.info.times);
    this.#cache = new BlockCache(this.#blocks, {
      load: (played, signal) => this.#load(played, signal),
      release: ({ segment }, block) => display.release(segment, block),
      onLoaded: () => {
        this.show();
        send({ type: "progress" });
      },
      onError: ({ start, nFrames, block }, error) => {
        send({ type: "error", error, block: block ?? 0, frames: { start, nFrames } });
        this.show();
      },
    });
  }

  /** Play, from the start if the end was reached; retries blocks that failed to load. */
  play(): void {
    const wasWaiting = this.isWaiting;
    if (this.isPlaying) return this.retry();
    const position = this.clock.position;
    this.clock.rewind();
    this.isPlaying = true;
    if (this.clock.position !== position) this.#masterClock?.seek(this.clock.position);
    this.#masterClock?.play();
    this.retry();
    if (!wasWaiting && !this.isWaiting) this.#send({ type: "playing" });
  }

  /** Retry blocks that failed to load, except for damaged ones. */
  retry(): void {
    this.#cache.retry();
    this.show();
  }

  pause(): void {
    this.isPlaying = false;
    this.#masterClock?.pause();
  }

  /**
   * Seek to a time in frames.
   *
   * @throws InvalidInputError if it is not a finite number.
   */
  seek(position: number): void {
    requireFinite("a time", position);
    this.clock.seek(position);
    this.#masterClock?.seek(this.clock.position);
    this.retry();
  }

  /**
   * Change the loop or the speed.
   *
   * @throws InvalidInputError if the speed is not finite, or a video drives the time and does not
   *   support them.
   */
  change(settings: Partial<ClockSettings>): void {
    if ("speed" in settings) requireFinite("speed", settings.speed);
    this.#masterClock?.change(settings);
    Object.assign(this.clock, settings);
    this.show();
  }

  /** Whether a block that is needed now or next is being loaded. */
  get isLoading(): boolean {
    return this.#cache.isLoading;
  }

  /** Ranges of frames that can be shown without loading, in ascending order. */
  get loaded(): readonly FrameRange[] {
    const ranges: { start: number; nFrames: number }[] = [];
    for (const { start, nFrames, loaded } of this.#blocks) {
      if (!loaded) continue;
      const last = ranges.at(-1);
      if (last && last.start + last.nFrames === start) last.nFrames += nFrames;
      else ranges.push({ start, nFrames });
    }
    return ranges;
  }

  /**
   * Advance by real time, in seconds, and show the picture.
   *
   * @throws InvalidInputError if `seconds` is negative or not finite.
   */
  update(seconds: number): void {
    if (!(seconds >= 0 && seconds < Infinity)) {
      throw new InvalidInputError(`seconds must be finite and at least 0; got ${seconds}`);
    }
    if (this.#masterClock) {
      this.#masterClock.update();
      return this.show();
    }
    const type = this.isPlaying && !this.isWaiting ? this.clock.advance(seconds) : null;
    if (type === "ended") this.isPlaying = false;
    this.show();
    if (type) this.#send({ type });
  }

  /**
   * Set what drives the time; null: the clock.
   *
   * @param nFrames - frames to play, at most those of the file
   * @throws InvalidInputError if it does not support the loop or the speed.
   */
  setMasterClock(masterClock: MasterClock | null, nFrames = this.nFrames): void {
    masterClock?.change(this.clock);
    this.#masterClock = masterClock;
    this.clock.nFrames = nFrames;
    if (this.clock.position > nFrames - 1) this.clock.seek(nFrames - 1);
  }

  /** Load all blocks again. Must be called once the display is ready, and when it lost its data. */
  restart(): void {
    this.#cache.request([]);
    this.#hasDisplay = true;
    this.#shown = null;
    this.show();
  }

  /** Release all blocks. */
  dispose(): void {
    this.isPlaying = false;
    this.#hasDisplay = false;
    this.#cache.request([]);
  }

  /** Show the current picture if it is available, and request its blocks and the next one. */
  show(): void {
    if (!this.#hasDisplay) return this.#masterClock?.setBlocked(true);
    let { frame, fraction } = this.clock.current(this.isInterpolating);
    const current = this.#blocks[this.#indexAt(frame)];
    let next = fraction > 0 ? this.#blocks[this.#indexAt(frame + 1)] : current;
    // A frame is not interpolated with a damaged one, or another segment.
    if (next.segment !== current.segment || next.isDamaged) [next, fraction] = [current, 0];
    const wanted = new Set([current, next, this.#blockAfter(current, next) ?? next]);
    this.#cache.request([...wanted].slice(0, MAX_BLOCKS));
    if (current.isDamaged) return this.#setWaiting(false);
    const missing = [current, next].find(({ loaded }) => !loaded);
    if (missing) return this.#setWaiting(true, missing.block ?? 0);
    if (this.#masterClock?.picture === "pending") return this.#setWaiting(true);
    this.#setWaiting(false);
    if (this.#masterClock?.picture === "over") return;
    const isNewPosition = this.#shown !== frame + fraction;
    if (isNewPosition) {
      this.#shown = frame + fraction;
      const t = frame - current.start;
      const nextT = fraction > 0 ? frame + 1 - next.start : t;
      const [block, nextBlock] = [current.loaded as LoadedBlock, next.loaded as LoadedBlock];
      const moment = { block, t, next: nextBlock, nextT, fraction };
      this.#display.show(current.segment, moment);
    }
    const isNewPicture = this.#masterClock?.show() ?? false;
    if (isNewPosition || isNewPicture) this.#send({ type: "frame", frame, time: this.clock.time });
  }

  /** Index of the block that contains a frame. */
  #indexAt(frame: number): number {
    return this.#blocks.findLastIndex((block) => block.start <= frame);
  }

  /** Load a block; opens its segment first. */
  async #load(played: PlayedBlock, signal: AbortSignal): Promise<LoadedBlock> {
    const { segment, start } = played;
    if (played.block === null) {
      const reel = await this.#file.segment(segment, { signal });
      signal.throwIfAborted();
      const [first, ...others] = playedBlocks(reel, segment, start);
      this.#blocks.splice(this.#blocks.indexOf(played) + 1, 0, ...others);
      Object.assign(played, first);
      this.show(); // the current frame may be in another block, which aborts this call
      signal.throwIfAborted();
    }
    return this.#display.load(segment, played.block ?? 0, signal);
  }

  /** The block that will be played after the current picture, which may lie between two blocks. */
  #blockAfter(current: PlayedBlock, next: PlayedBlock): PlayedBlock | undefined {
    const { nFrames, isForward, loop } = this.clock;
    const played = this.#blocks.slice(0, this.#indexAt(nFrames - 1) + 1);
    const [last, first] = isForward ? [next, current] : [current, next];
    if (!isForward) played.reverse();
    const after = played.slice(played.indexOf(last) + 1);
    if (loop === true) after.push(...played);
    if (loop === "pingpong") after.push(...played.slice(0, played.indexOf(first)).reverse());
    return after.find((block) => !block.isDamaged);
  }

  #setWaiting(isWaiting: boolean, block: number | null = null): void {
    const wasWaiting = this.isWaiting;
    this.isWaiting = isWaiting;
    this.#masterClock?.setBlocked(block !== null);
    if (isWaiting && !wasWaiting) this.#send({ type: "waiting", block });
    if (!isWaiting && wasWaiting && this.isPlaying) this.#send({ type: "playing" });
  }
}

/** Number the blocks of a segment that begins at a frame. */
function playedBlocks({ info }: OpenReel, segment: number, first: number): PlayedBlock[] {
  return info.blocks.map(({ start, nFrames }, block) => playedBlock(segment, block, first + start, nFrames));
}

function playedBlock(segment: number, block: number | null, start: number, nFrames: number): PlayedBlock {
  return { segment, block, start, nFrames, loaded: null, hasFailed: false, isDamaged: false };
}

function requireFinite(name: string, value: number | undefined): void {
  if (!Number.isFinite(value)) throw new InvalidInputError(`${name} must be a finite number; got ${value}`);
}
