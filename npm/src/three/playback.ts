// Playing: which picture is shown when, and what is told about it. Nothing here draws.

import { InvalidInputError } from "../errors.js";
import type { BlockFields, BlockInfo, ReelInfo } from "../types.js";
import { BlockWindow, MOST_HELD } from "./block_window.js";
import { Clock, type Loop } from "./clock.js";
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
  /**
   * The picture of the time is not there yet; the last one stays, and so does the time. It waits
   * for a block, or for the video of its texture (then the block is null).
   */
  waiting: { block: number | null };
  /** Pictures follow one another: after `play()`, and after waiting. */
  playing: object;
  /**
   * A block cannot be had, or a texture cannot be shown (then the block is null). `track` names the
   * track whose values are missing in the block; without it the positions are missing.
   */
  error: { error: Error; block: number | null; track?: string };
  /** It plays otherwise than was asked for, such as where a video is longer than the mesh. */
  warning: { message: string };
  /**
   * The number of its frame cannot be read in the picture of the video at a time in seconds; the
   * last picture stays, with its mesh.
   */
  unreadable: { time: number };
}

/** One of `PlaybackEvents`, with its type. */
export type PlaybackEvent = {
  [Type in keyof PlaybackEvents]: { type: Type } & PlaybackEvents[Type];
}[keyof PlaybackEvents];

/** Where pictures go. */
export interface Screen {
  /** Takes the fields of a block, which may come into pictures until it is released. */
  hold(block: BlockFields): HeldBlock | Promise<HeldBlock>;
  release(block: HeldBlock): void;
  show(moment: Moment): void;
}

/** What leads the time in place of the clock: a video, whose pictures the mesh follows. */
export interface Leader {
  /**
   * Its picture of the time: to come, taken, or of a frame that is not known. What is taken has
   * been told to `Playback.follow`.
   */
  readonly picture: "awaited" | "taken" | "unknown";
  /** Shows what was taken; false where nothing was since the last time. */
  show(): boolean;
  play(): void;
  pause(): void;
  /** Goes to a place in frames; the picture is awaited from now on. */
  seek(place: number): void;
  /** @throws InvalidInputError where it cannot play that fast. */
  setSpeed(speed: number): void;
  /** Whether the mesh is not there yet: it stands still meanwhile. */
  hold(isHeld: boolean): void;
  /** A picture of the page is about to be drawn. */
  update(): void;
}

/** Plays the blocks of a file on a screen. */
export class Playback {
  readonly #screen: Screen;
  readonly #send: (event: PlaybackEvent) => void;
  /** The time, and how it passes. */
  readonly clock: Clock;
  /** Of the file. */
  readonly nFrames: number;
  /** Whether pictures between frames are shown. */
  isInterpolating = true;
  #nMoving = Infinity;
  /** Whether it plays, or will once it need not wait. */
  isPlaying = false;
  /** Whether the picture of the time is not there yet; at first it is not. */
  isWaiting = true;
  readonly #window: BlockWindow<HeldBlock>;
  readonly #blocks: readonly BlockInfo[];
  #leader: Leader | null = null;
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
    this.nFrames = end.start + end.nFrames;
    this.clock = new Clock(this.nFrames, info.fps > 0 ? info.fps : DEFAULT_FPS);
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
    if (this.isPlaying) return this.retry();
    const place = this.clock.place;
    this.clock.rewind();
    this.isPlaying = true;
    if (this.clock.place !== place) this.#leader?.seek(this.clock.place);
    this.#leader?.play();
    this.retry();
    if (!wasWaiting && !this.isWaiting) this.#send({ type: "playing" });
  }

  /** Asks again for what could not be had for another reason than damage. */
  retry(): void {
    this.#window.retry();
    this.show();
  }

  /** Stands still at the time. */
  pause(): void {
    this.isPlaying = false;
    this.#leader?.pause();
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
    this.#leader?.seek(this.clock.place);
    this.retry();
  }

  /** @throws InvalidInputError if a video leads that cannot do it. */
  setLoop(loop: Loop): void {
    if (this.#leader) requireForward(loop, this.clock.speed);
    this.clock.loop = loop;
  }

  /** @throws InvalidInputError if it is not finite, or a video leads that cannot do it. */
  setSpeed(speed: number): void {
    if (!Number.isFinite(speed)) {
      throw new InvalidInputError(`speed must be a finite number; got ${speed}`);
    }
    if (this.#leader) requireForward(this.clock.loop, speed);
    this.#leader?.setSpeed(speed);
    this.clock.speed = speed;
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
    if (this.#leader) {
      this.#leader.update();
      return this.show();
    }
    const isMoving = this.isPlaying && !this.isWaiting;
    const passed = isMoving ? this.clock.advance(seconds) : null;
    if (passed === "end") this.isPlaying = false;
    this.show();
    if (passed === "loop") this.#send({ type: "loop" });
    if (passed === "end") this.#send({ type: "ended" });
  }

  /**
   * Has something lead the time; null: the clock does again.
   *
   * @param nFrames - that are played, where these are fewer than the file has
   * @throws InvalidInputError where time goes backwards, which it does for no leader.
   */
  setLeader(leader: Leader | null, nFrames = this.nFrames): void {
    if (leader) requireForward(this.clock.loop, this.clock.speed);
    this.#leader = leader;
    this.clock.nFrames = nFrames;
    if (this.clock.place > nFrames - 1) this.clock.set(nFrames - 1);
  }

  /** The leader is at a place in frames, whose picture is awaited or taken. */
  follow(place: number): void {
    this.clock.set(place);
    this.show();
  }

  /** The leader is at the end of what is played. */
  finish(): void {
    const { clock } = this;
    if (!this.isPlaying) {
      clock.set(clock.nFrames - 1);
      this.#leader?.seek(clock.place);
    } else if (clock.loop === "once") {
      this.isPlaying = false;
      this.#leader?.pause();
      clock.finish();
      this.#send({ type: "ended" });
    } else {
      clock.set(0);
      this.#leader?.seek(0);
      this.#leader?.play();
      this.#send({ type: "loop" });
    }
    this.show();
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
    if (!this.#hasScreen) return this.#leader?.hold(true);
    const { frame, fraction } = this.#pictureOfNow();
    const number = this.#blockOf(frame);
    const next = fraction > 0 ? this.#blockOf(frame + 1) : number;
    const wanted = new Set([number, next, ...this.#following(number, next)]);
    this.#window.want([...wanted].slice(0, MOST_HELD));
    if (this.#window.isDamaged(number)) return this.#setWaiting(null);
    const [block, nextBlock] = [this.#window.get(number), this.#window.get(next)];
    if (!block || !nextBlock) return this.#setWaiting({ block: block ? next : number });
    if (this.#leader?.picture === "awaited") return this.#setWaiting({ block: null });
    this.#setWaiting(null);
    if (this.#leader?.picture === "unknown") return;
    const isOther = this.#shown?.frame !== frame || this.#shown.fraction !== fraction;
    if (isOther) {
      this.#shown = { frame, fraction };
      const nextT = fraction > 0 ? frame + 1 - nextBlock.start : frame - block.start;
      const [t, nMoving] = [frame - block.start, this.#nMoving];
      this.#screen.show({ block, t, next: nextBlock, nextT, fraction, nMoving });
    }
    const isOtherPicture = this.#leader?.show() ?? false;
    if (isOther || isOtherPicture) this.#send({ type: "frame", frame, time: this.clock.time });
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

  #setWaiting(missing: { block: number | null } | null): void {
    const wasWaiting = this.isWaiting;
    this.isWaiting = missing !== null;
    this.#leader?.hold(missing !== null && missing.block !== null);
    if (missing && !wasWaiting) this.#send({ type: "waiting", ...missing });
    if (!missing && wasWaiting && this.isPlaying) this.#send({ type: "playing" });
  }
}

/** @throws InvalidInputError where time goes backwards, which videos cannot. */
function requireForward(loop: Loop, speed: number): void {
  if (loop !== "pingpong" && speed >= 0) return;
  const what = speed < 0 ? `the speed ${speed}` : 'the loop "pingpong"';
  throw new InvalidInputError(`a video plays forwards only, and its mesh with it; got ${what}`);
}
