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
 * Time in frames, 0 to `nFrames`. A frame lasts until the time of the next one, and the last one as long
 * as frames on average; it is not interpolated with the first.
 */
export class Clock implements ClockSettings {
  speed = 1;
  #loop: Loop = true;
  /** Time in frames; `seek` changes it. */
  position = 0;
  /** -1 while "pingpong" plays in reverse, else 1. */
  #direction = 1;
  /** Start of each frame and end of the last one, in mean durations; null if all are equal. */
  readonly #starts: readonly number[] | null = null;

  /**
   * @param nFrames - number of frames that can be played, at least 1
   * @param fps - frames per second on average, above 0
   * @param times - times of the frames in seconds; null if they are evenly spaced
   */
  constructor(
    public nFrames: number,
    readonly fps: number,
    times: ArrayLike<number> | null = null,
  ) {
    if (!times) return;
    const starts = Array.from(times, (time) => (time - times[0]) * fps);
    this.#starts = [...starts, starts[nFrames - 1] + 1];
  }

  get loop(): Loop {
    return this.#loop;
  }

  set loop(loop: Loop) {
    this.#loop = loop;
    if (loop !== "pingpong") this.#direction = 1;
  }

  /** Time in seconds. */
  get time(): number {
    return this.#toDurations(this.position) / this.fps;
  }

  /** Duration of all frames, in seconds. */
  get duration(): number {
    return this.#toDurations(this.nFrames) / this.fps;
  }

  get isForward(): boolean {
    return this.speed * this.#direction >= 0;
  }

  /** Return the position in frames of a time in seconds. */
  positionAt(seconds: number): number {
    return this.#fromDurations(seconds * this.fps);
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
    const to = this.#toDurations(this.position) + seconds * this.fps * this.speed * this.#direction;
    const end = this.#toDurations(nFrames);
    if (!loop) {
      const isOver = this.isForward ? to >= end : to < 0;
      this.position = this.#fromDurations(Math.min(Math.max(to, 0), end));
      return isOver ? "ended" : null;
    }
    // "pingpong" turns around at the last frame; otherwise it is played to its end.
    const length = loop === "pingpong" ? this.#toDurations(nFrames - 1) : end;
    const nLoops = length && Math.floor(to / length);
    const rest = length && to - nLoops * length;
    const isReversed = loop === "pingpong" && nLoops % 2 !== 0;
    if (isReversed) this.#direction = -this.#direction;
    this.position = this.#fromDurations(isReversed ? length - rest : rest);
    if (this.position >= nFrames) this.position = 0; // by rounding
    return nLoops ? "loop" : null;
  }

  /** Convert a position in frames to mean durations. */
  #toDurations(position: number): number {
    if (!this.#starts) return position;
    const frame = Math.min(Math.floor(position), this.nFrames - 1);
    const [start, end] = this.#starts.slice(frame, frame + 2);
    return start + (position - frame) * (end - start);
  }

  /** Convert mean durations to a position in frames. */
  #fromDurations(durations: number): number {
    if (!this.#starts || durations <= 0) return durations;
    const found = this.#starts.findLastIndex((start) => start <= durations);
    const frame = Math.min(found, this.nFrames - 1);
    const [start, end] = this.#starts.slice(frame, frame + 2);
    return frame + (durations - start) / (end - start);
  }
}
