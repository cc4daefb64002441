// Playing: which picture is shown when, and what is told about it. Nothing here draws.

import { InvalidInputError } from "../errors.js";
import type { BlockFields, BlockInfo, ReelInfo } from "../types.js";
import { BlockWindow, MOST_HELD } from "./block_window.js";
import { Clock } from "./clock.js";
import type { HeldBlock, Moment } from "./held_block.js";

/** Frames per second to play at where the file does not say. */
export const DEFAULT_FPS = 24;

/** What playing tells. */
export interface PlaybackEvents {
  /** Another picture is shown: the frame, and the time in seconds since the first. */
  frame: { frame: number; time: number };
  /** The end was passed, and it goes on. */
  loop: object;
  /** The end was reached. */
  ended: object;
  /** The picture of the time is not there yet; the last one stays, and so does the time. */
  waiting: { block: number };
  /** Pictures follow one another: after `play()`, and after waiting. */
  playing: object;
  /** A block cannot be had, or an image cannot be shown (then the block is null). */
  error: { error: Error; block: number | null };
}

/** One of `PlaybackEvents`, with its type. */
export type PlaybackEvent = {
  [Type in keyof PlaybackEvents]: { type: Type } & PlaybackEvents[Type];
}[keyof PlaybackEvents];

/** Where pictures go. */
export interface Screen {
  /** Takes the fields of a block, which may come into pictures until it is released. */
  hold(block: BlockFields): HeldBlock;
  release(block: HeldBlock): void;
  show(moment: Moment): void;
}

/** Plays the blocks of a file on a screen. */
export class Playback {
  readonly #screen: Screen;
  readonly #send: (event: PlaybackEvent) => void;
  /** The time, and how it passes. */
  readonly clock: Clock;
  /** Whether pictures between frames are shown. */
  isInterpolating = true;
  #nMoving = Infinity;
  /** Whether it plays, or will once it need not wait. */
  isPlaying = false;
  /** Whether the picture of the time is not there yet; at first it is not. */
  isWaiting = true;
  readonly #window: BlockWindow<HeldBlock>;
  readonly #blocks: readonly BlockInfo[];
  #hasScreen = false;
  #shown: { frame: number; fraction: number } | null = null;

  /** @throws InvalidInputError where the file has no frames. */
  constructor(
    info: ReelInfo,
    load: (block: number, signal: AbortSignal) => Promise<BlockFields>,
    screen: Screen,
    send: (event: PlaybackEvent) => void,
  ) {
    this.#screen = screen;
    this.#send = send;
    this.#blocks = info.blocks;
    const end = info.blocks.at(-1);
    if (!end) throw new InvalidInputError(`the reel ${info.name} has no frames`);
    this.clock = new Clock(end.start + end.nFrames, info.fps > 0 ? info.fps : DEFAULT_FPS);
    this.#window = new BlockWindow(
      async (number, signal) => {
        const block = await load(number, signal);
        signal.throwIfAborted();
        return screen.hold(block);
      },
      (block) => screen.release(block),
      () => this.show(),
      (block, error) => {
        send({ type: "error", error, block });
        this.show();
      },
    );
  }

  /** Plays on, or from the start if it has ended; asks again for what could not be had. */
  play(): void {
    const wasWaiting = this.isWaiting;
    this.#window.retry();
    if (this.isPlaying) return this.show();
    this.clock.rewind();
    this.isPlaying = true;
    this.show();
    if (!wasWaiting && !this.isWaiting) this.#send({ type: "playing" });
  }

  /** Stands still at the time. */
  pause(): void {
    this.isPlaying = false;
  }

  /**
   * Goes to a time, in frames.
   *
   * @throws InvalidInputError if it is not a finite number.
   */
  seek(place: number): void {
    if (!Number.isFinite(place)) {
      throw new InvalidInputError(`a time must be a finite number; got ${place}`);
    }
    this.clock.set(place);
    this.#window.retry();
    this.show();
  }

  /**
   * Lets seconds pass, and shows what is there then.
   *
   * @throws InvalidInputError if they are negative or not finite.
   */
  update(seconds: number): void {
    if (!(seconds >= 0 && seconds < Infinity)) {
      throw new InvalidInputError(`seconds must be a finite number from 0 on; got ${seconds}`);
    }
    const isMoving = this.isPlaying && !this.isWaiting;
    const passed = isMoving ? this.clock.advance(seconds) : null;
    if (passed === "end") this.isPlaying = false;
    this.show();
    if (passed === "loop") this.#send({ type: "loop" });
    if (passed === "end") this.#send({ type: "ended" });
  }

  /** Loads anew: the screen is there now, or has lost what it held. Nothing is loaded before. */
  restart(): void {
    this.#window.clear();
    this.#hasScreen = true;
    this.#shown = null;
    this.show();
  }

  /** Lets all blocks go for good. */
  dispose(): void {
    this.isPlaying = false;
    this.#hasScreen = false;
    this.#window.clear();
  }

  /** Modes of each block that move. */
  get nMoving(): number {
    return this.#nMoving;
  }

  set nMoving(count: number) {
    if (count === this.#nMoving) return;
    this.#nMoving = count;
    this.#shown = null;
    this.show();
  }

  /** Shows the picture of the time if it is there, and asks for what it needs and what follows. */
  show(): void {
    if (!this.#hasScreen) return;
    const { frame, fraction } = this.#pictureOfNow();
    const number = this.#blockOf(frame);
    const next = fraction > 0 ? this.#blockOf(frame + 1) : number;
    const wanted = new Set([number, next, ...this.#following(number, next)]);
    this.#window.want([...wanted].slice(0, MOST_HELD));
    if (this.#window.isDamaged(number)) return this.#setWaiting(null);
    const [block, nextBlock] = [this.#window.get(number), this.#window.get(next)];
    if (!block || !nextBlock) return this.#setWaiting(block ? next : number);
    this.#setWaiting(null);
    if (this.#shown?.frame === frame && this.#shown.fraction === fraction) return;
    this.#shown = { frame, fraction };
    const nextT = fraction > 0 ? frame + 1 - nextBlock.start : frame - block.start;
    const [t, nMoving] = [frame - block.start, this.#nMoving];
    this.#screen.show({ block, t, next: nextBlock, nextT, fraction, nMoving });
    this.#send({ type: "frame", frame, time: this.clock.time });
  }

  /** Nothing lies between a frame and one of a damaged block. */
  #pictureOfNow(): { frame: number; fraction: number } {
    const { frame, fraction } = this.clock.at(this.isInterpolating);
    const isAlone = fraction > 0 && this.#window.isDamaged(this.#blockOf(frame + 1));
    return { frame, fraction: isAlone ? 0 : fraction };
  }

  #blockOf(frame: number): number {
    return this.#blocks.findLastIndex((block) => block.start <= frame);
  }

  /** The block that comes after these, as it is played now; none behind the end. */
  #following(number: number, next: number): number[] {
    const count = this.#blocks.length;
    const step = this.clock.isForward ? 1 : -1;
    let after = step > 0 ? next : number;
    for (let i = 0; i < count; i++) {
      after += step;
      if (after < 0 || after >= count) {
        if (this.clock.loop === "once") return [];
        if (this.clock.loop === "repeat") after = (after + count) % count;
        else return [step > 0 ? number - 1 : next + 1].filter((one) => one in this.#blocks);
      }
      if (!this.#window.isDamaged(after)) return [after];
    }
    return [];
  }

  #setWaiting(block: number | null): void {
    const wasWaiting = this.isWaiting;
    this.isWaiting = block !== null;
    if (block !== null && !wasWaiting) this.#send({ type: "waiting", block });
    if (block === null && wasWaiting && this.isPlaying) this.#send({ type: "playing" });
  }
}
