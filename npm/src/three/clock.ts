// The playback time.

/** What happens at the end: start again, reverse, or stop. */
export type Loop = "repeat" | "pingpong" | "once";

/** What happened while the clock advanced. */
export type ClockEvent = "loop" | "end" | null;

/** A position in the animation: a frame, or `fraction` of the way to the next one. */
export interface FramePosition {
  readonly frame: number;
  /** In [0, 1). */
  readonly fraction: number;
}

/**
 * Time in frames, 0 to `nFrames`. All frames last equally long; the last frame is not interpolated
 * with the first.
 */
export class Clock {
  /** Playback rate; negative values play backwards. */
  speed = 1;
  #loop: Loop = "repeat";
  #position = 0;
  /** -1 while "pingpong" plays in reverse, else 1. */
  #direction = 1;

  /**
   * @param nFrames - number of frames to play, at least 1
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

  /** Time in frames. */
  get position(): number {
    return this.#position;
  }

  /** Time in seconds. */
  get time(): number {
    return this.#position / this.fps;
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
    const frame = Math.min(Math.floor(this.#position), last);
    return { frame, fraction: interpolate && frame < last ? this.#position - frame : 0 };
  }

  /** Set the time in frames, clamped to the first and the last frame. */
  seek(position: number): void {
    this.#position = Math.min(Math.max(position, 0), this.nFrames - 1);
  }

  /** Move to the end of the last frame. */
  goToEnd(): void {
    this.#position = this.nFrames;
  }

  /** Move to the start if the end was reached, with the loop "once". */
  rewind(): void {
    if (this.loop !== "once") return;
    if (this.isForward && this.#position >= this.nFrames) this.#position = 0;
    if (!this.isForward && this.#position <= 0) this.#position = this.nFrames;
  }

  /** Advance by real time, in seconds. */
  advance(seconds: number): ClockEvent {
    const to = this.#position + seconds * this.fps * this.speed * this.#direction;
    if (this.loop === "pingpong") return this.#reflect(to);
    const isOver = this.isForward ? to >= this.nFrames : to < 0;
    if (this.loop === "once") {
      this.#position = Math.min(Math.max(to, 0), this.nFrames);
      return isOver ? "end" : null;
    }
    this.#position = to - Math.floor(to / this.nFrames) * this.nFrames;
    if (this.#position >= this.nFrames) this.#position = 0; // by rounding
    return isOver ? "loop" : null;
  }

  #reflect(to: number): ClockEvent {
    const last = this.nFrames - 1;
    if ((to >= 0 && to <= last) || last === 0) {
      this.#position = last && to;
      return null;
    }
    const lengths = Math.floor(to / last);
    const rest = to - lengths * last;
    const isBack = lengths % 2 !== 0;
    this.#position = isBack ? last - rest : rest;
    if (isBack) this.#direction = -this.#direction;
    return "loop";
  }
}
