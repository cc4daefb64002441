// The time of the animation while it plays.

export class Clock {
  speed = 1;
  isLooping = true;
  isPlaying = false;
  /** In frames, with fractions. */
  time = 0;
  private last: number | null = null;

  constructor(
    private readonly nFrames: number,
    private readonly fps: number,
  ) {}

  play(): void {
    if (!this.isLooping && this.time >= this.nFrames - 1) this.time = 0;
    this.isPlaying = true;
    this.last = null;
  }

  pause(): void {
    this.isPlaying = false;
    this.time = Math.floor(this.time);
  }

  /** Lets the time pass since the last call; at the end it starts again, or stops. */
  advance(nowMs: number): void {
    const passed = this.last === null ? 0 : (nowMs - this.last) / 1000;
    this.last = nowMs;
    this.time += passed * this.fps * this.speed;
    if (this.time < this.nFrames) return;
    if (this.isLooping) {
      this.time %= this.nFrames;
    } else {
      this.time = this.nFrames - 1;
      this.isPlaying = false;
    }
  }

  /** Waits: the time since the last call does not count. */
  hold(nowMs: number): void {
    this.last = nowMs;
  }
}
