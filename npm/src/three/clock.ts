// The playback time.

/** Whether playback repeats from the start, or forwards and backwards; false: it stops at the end. */
export type Loop = boolean | "pingpong";

/** What happened while the clock advanced. */
export type ClockEvent = "loop" | "ended" | null;

/** A position in the animation: a frame, or `fraction` of the way to the next one. */
export interface FramePosition {
  readonly frame: number;
  /** In [0, 1). */
  readonly fraction: number;
}

/** Consecutive frames, in the numbering of the file. */
export interface FrameRange {
  readonly start: number;
  readonly nFrames: number;
}

/** How frames are played. */
export interface ClockSettings {
  loop: Loop;
  /** Playback rate; negative values play backwards. */
  speed: number;
}

/**
 * Time in frames, 0 to `nFrames`. All frames last equally long; the last frame is not interpolated with
 * the first.
 */
export class Clock implements ClockSettings {
  speed = 1;
  #loop: Loop = true;
  /** Time in frames; `seek` changes it. */
  position = 0;
  /** -1 while "pingpong" plays in reverse, else 1. */
  #direction = 1;

  /**
   * @param nFrames - number of frames that can be played, at least 1
   * @param fps - frames per second, above 0
   */
  constructor(
    public nFrames: number,
    readonly fps: number,
  ) {}

  get loop(): Loop {
    return this.#loop;
  }

  set loop(loop: Loop) {
    this.#loop = loop;
    if (loop !== "pingpong") this.#direction = 1;
  }

  /** Time in seconds. */
  get time(): number {
    return this.position / this.fps;
  }

  /** Duration of all frames, in seconds. */
  get duration(): number {
    return this.nFrames / this.fps;
  }

  get isForward(): boolean {
    return this.speed * this.#direction >= 0;
  }

  /** Return the current position, between frames only if `interpolate` is true. */
  current(interpolate: boolean): FramePosition {
    const last = this.nFrames - 1;
    const frame = Math.min(Math.floor(this.position), last);
    return { frame, fraction: interpolate && frame < last ? this.position - frame : 0 };
  }

  /** Set the time in frames, clamped to the first and the last frame. */
  seek(position: number): void {
    this.position = Math.min(Math.max(position, 0), this.nFrames - 1);
  }

  /** Move to the end of the last frame. */
  goToEnd(): void {
    this.position = this.nFrames;
  }

  /** Move to the start if the end was reached, and playback does not repeat. */
  rewind(): void {
    if (this.loop) return;
    if (this.isForward && this.position >= this.nFrames) this.position = 0;
    if (!this.isForward && this.position <= 0) this.position = this.nFrames;
  }

  /** Advance by real time, in seconds. */
  advance(seconds: number): ClockEvent {
    const { nFrames, loop } = this;
    const to = this.position + seconds * this.fps * this.speed * this.#direction;
    if (!loop) {
      const isOver = this.isForward ? to >= nFrames : to < 0;
      this.position = Math.min(Math.max(to, 0), nFrames);
      return isOver ? "ended" : null;
    }
    // "pingpong" turns around at the last frame; otherwise it is played to its end.
    const length = loop === "pingpong" ? nFrames - 1 : nFrames;
    const nLoops = length && Math.floor(to / length);
    const rest = length && to - nLoops * length;
    const isReversed = loop === "pingpong" && nLoops % 2 !== 0;
    if (isReversed) this.#direction = -this.#direction;
    this.position = isReversed ? length - rest : rest;
    if (this.position >= nFrames) this.position = 0; // by rounding
    return nLoops ? "loop" : null;
  }
}
