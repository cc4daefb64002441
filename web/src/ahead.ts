// What comes one frame at a time (heat, the original) is asked for ahead of the playback, as far
// as the server is slow, and as densely as it is fast.

import type { Cache } from "./cache";

const N_AT_ONCE = 3;

export class Lookahead {
  private latencyS = 0.05;

  constructor(
    private readonly nFrames: number,
    private readonly framesPerSecond: number,
  ) {}

  /** Asks for the frames that can arrive before they are shown, as far as there is room. */
  foresee<T>(
    cache: Cache<T>,
    shown: number,
    speed: number,
    failed: (error: unknown) => void,
  ): void {
    const rate = this.framesPerSecond * speed;
    const stride = Math.max(1, Math.ceil((this.latencyS * rate) / N_AT_ONCE));
    const lead = Math.ceil(this.latencyS * rate) + 1;
    let next = Math.ceil((shown + lead) / stride) * stride;
    for (let tries = 0; tries < N_AT_ONCE && cache.nLoading < N_AT_ONCE; tries++, next += stride) {
      const frame = next % this.nFrames;
      if (!cache.isKnown(frame)) void this.timed(cache.load(frame)).catch(failed);
    }
  }

  private async timed(loading: Promise<unknown>): Promise<void> {
    const started = performance.now();
    await loading;
    const seconds = (performance.now() - started) / 1000;
    this.latencyS += 0.2 * (seconds - this.latencyS);
  }
}
