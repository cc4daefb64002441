// The time of the animation while it plays.

/** What happens at the end: from the start again, there and back, or nothing more. */
export type Loop = "repeat" | "pingpong" | "once";

/** What time has passed while the clock was advanced. */
export type Passed = "loop" | "end" | null;

/** A picture: a frame, or `fraction` of the way from it to the next. */
export interface Place {
  readonly frame: number;
  /** 0 up to, but not, 1. */
  readonly fraction: number;
}

/**
 * Time in frames, 0 to `nFrames`: each frame is there for as long as every other, and from the last
 * one to the first nothing lies between.
 */
export class Clock {
  /** Seconds of the animation in a second; backwards if negative. */
  speed = 1;
  #loop: Loop = "repeat";
  #place = 0;
  /** -1 on the way back of "pingpong", else 1. */
  #heading = 1;

  /**
   * @param nFrames - that are played, at least 1
   * @param fps - frames per second, above 0
   */
  constructor(
    public nFrames: number,
    readonly fps: number,
  ) {}

  /** What happens at the end. */
  get loop(): Loop {
    return this.#loop;
  }

  set loop(loop: Loop) {
    this.#loop = loop;
    if (loop !== "pingpong") this.#heading = 1; // only "pingpong" turns around
  }

  /** Frames since the first frame. */
  get place(): number {
    return this.#place;
  }

  /** Seconds since the first frame. */
  get time(): number {
    return this.#place / this.fps;
  }

  /** Of all frames, in seconds. */
  get duration(): number {
    return this.nFrames / this.fps;
  }

  get isForward(): boolean {
    return this.speed * this.#heading >= 0;
  }

  /** Where the time is, in frames; `between` says whether pictures between frames are wanted. */
  at(between: boolean): Place {
    const last = this.nFrames - 1;
    const frame = Math.min(Math.floor(this.#place), last);
    return { frame, fraction: between && frame < last ? this.#place - frame : 0 };
  }

  /** Sets the time, in frames; what lies outside is moved to the first or the last frame. */
  set(place: number): void {
    this.#place = Math.min(Math.max(place, 0), this.nFrames - 1);
  }

  /** Goes to where nothing more is played. */
  finish(): void {
    this.#place = this.nFrames;
  }

  /** Goes to where playing begins, if the time is where it ends. */
  rewind(): void {
    if (this.loop !== "once") return;
    if (this.isForward && this.#place >= this.nFrames) this.#place = 0;
    if (!this.isForward && this.#place <= 0) this.#place = this.nFrames;
  }

  /** Lets seconds pass. */
  advance(seconds: number): Passed {
    const to = this.#place + seconds * this.fps * this.speed * this.#heading;
    if (this.loop === "pingpong") return this.#reflect(to);
    const isOver = this.isForward ? to >= this.nFrames : to < 0;
    if (this.loop === "once") {
      this.#place = Math.min(Math.max(to, 0), this.nFrames);
      return isOver ? "end" : null;
    }
    this.#place = to - Math.floor(to / this.nFrames) * this.nFrames;
    if (this.#place >= this.nFrames) this.#place = 0; // by rounding
    return isOver ? "loop" : null;
  }

  #reflect(to: number): Passed {
    const last = this.nFrames - 1;
    if ((to >= 0 && to <= last) || last === 0) {
      this.#place = last && to;
      return null;
    }
    const lengths = Math.floor(to / last);
    const rest = to - lengths * last;
    const isBack = lengths % 2 !== 0;
    this.#place = isBack ? last - rest : rest;
    if (isBack) this.#heading = -this.#heading;
    return "loop";
  }
}
