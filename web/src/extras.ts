// Data that come one frame at a time beside the modes: values of a heat map, and the original. The
// errors of the mesh of fewer modes than all are computed here; the server has those of all modes.

import { Cache } from "./cache";
import { loadPacket } from "./data";
import { largest, type FrameErrors, type HeatFields } from "./heat_fields";
import type { Picture } from "./picture";
import { playingFps, type Reel } from "./reel";

const KEPT_BYTES = 128e6;
const LEAST_KEPT = 8;
const N_AT_ONCE = 3;

export class Extras {
  heatKind: string | null = null;
  isPerFrameRange = false;
  /** The value that is painted hottest. */
  hottest = 0;
  /** How many modes are shown where they are not all. */
  fewModes: number | null = null;
  /** Of the frame shown with few modes, beside an original. */
  frameErrors: (FrameErrors & { frame: number }) | null = null;
  private readonly originals: Cache<Float32Array>;
  private readonly heats = new Map<string, Cache<Float32Array>>();
  private readonly ahead: Lookahead;
  private shownOriginal = -1;
  private shownHeat = "";
  /** The largest value of few modes so far, of which kind and how many. */
  private seen = { key: "", largest: 0 };

  constructor(
    private readonly reel: Reel,
    private readonly picture: Picture,
    private readonly fields: HeatFields,
    private readonly decodedAt: (frame: number) => Float32Array | null,
  ) {
    this.originals = frameCache("api/original", "positions", [reel.n_verts, 3]);
    this.ahead = new Lookahead(reel.n_frames, playingFps(reel));
  }

  /** Has heat painted anew, since its kind or its range has changed. */
  forgetHeat(): void {
    this.shownHeat = "";
    if (this.heatKind === null) this.picture.setHeat(null);
  }

  /** Fetches the data of a frame. */
  async load(frame: number): Promise<void> {
    await Promise.all([
      this.heatCache()?.load(frame),
      this.needsOriginal ? this.originals.load(frame) : null,
    ]);
  }

  /** Fetches the data of the frames after this one, while it plays. */
  prefetch(frame: number, speed: number, failed: (error: unknown) => void): void {
    const heats = this.heatCache();
    if (heats) this.ahead.prefetch(heats, frame, speed, failed);
    if (this.needsOriginal) this.ahead.prefetch(this.originals, frame, speed, failed);
  }

  /** Shows the data of a frame that are here; the rest stays. True if anything has changed. */
  show(frame: number): boolean {
    const showsHeat = this.comparesFew ? this.showErrorsOfFew(frame) : this.showHeat(frame);
    return this.showOriginal(frame) || showsHeat;
  }

  /** Whether all that is shown is of this frame. */
  areOf(frame: number): boolean {
    const isPainted = this.heatKind !== null || this.comparesFew;
    const isHeatRight = !isPainted || this.shownHeat === this.heatKey(frame);
    return isHeatRight && (!this.picture.needsOriginal || this.shownOriginal === frame);
  }

  private get comparesFew(): boolean {
    return this.fewModes !== null && this.reel.original !== null;
  }

  private get needsOriginal(): boolean {
    return this.picture.needsOriginal || this.comparesFew;
  }

  private showHeat(frame: number): boolean {
    this.frameErrors = null;
    const values = this.heatCache()?.peek(frame);
    if (!values || this.heatKey(frame) === this.shownHeat) return false;
    this.paint(values, this.fixedRange(), frame);
    return true;
  }

  private showErrorsOfFew(frame: number): boolean {
    const original = this.originals.peek(frame);
    if (!original || this.heatKey(frame) === this.shownHeat) return false;
    const decoded = this.decodedAt(frame);
    if (!decoded) return false;
    this.frameErrors = { frame, ...this.fields.errors(original, decoded) };
    this.shownHeat = this.heatKey(frame);
    if (this.heatKind === null) return true;
    const values = this.fields.of(this.heatKind, original, decoded);
    this.paint(values, this.rangeOfFew(largest(values)), frame);
    return true;
  }

  private paint(values: Float32Array, range: number, frame: number): void {
    this.hottest = this.isPerFrameRange ? largest(values) : range;
    this.picture.setHeat({ values, hottest: this.hottest });
    this.shownHeat = this.heatKey(frame);
  }

  /** The range of all modes, widened by the values of few modes so far. */
  private rangeOfFew(value: number): number {
    const key = `${this.heatKind} ${this.fewModes}`;
    if (key !== this.seen.key) this.seen = { key, largest: 0 };
    this.seen.largest = Math.max(this.seen.largest, value);
    return Math.max(this.seen.largest, this.fixedRange());
  }

  private showOriginal(frame: number): boolean {
    const positions = this.picture.needsOriginal ? this.originals.peek(frame) : undefined;
    if (!positions || frame === this.shownOriginal) return false;
    this.picture.setOriginal(positions);
    this.shownOriginal = frame;
    return true;
  }

  private heatKey(frame: number): string {
    return `${this.heatKind} ${this.fewModes} ${frame}`;
  }

  /** Values that the server has measured; null where none are shown. */
  private heatCache(): Cache<Float32Array> | null {
    const kind = this.heatKind;
    if (kind === null || this.comparesFew) return null;
    const cache =
      this.heats.get(kind) ?? frameCache(`api/heat/${kind}`, "values", [this.reel.n_verts]);
    this.heats.set(kind, cache);
    return cache;
  }

  private fixedRange(): number {
    const info = this.reel.original?.heats.find((heat) => heat.kind === this.heatKind);
    return info?.range || info?.maximum || 1;
  }
}

function frameCache(url: string, name: string, shape: number[]): Cache<Float32Array> {
  const bytes = 4 * shape.reduce((product, length) => product * length, 1);
  const load = async (frame: number) =>
    (await loadPacket(`${url}/${frame}`)).array(name, "float32", shape) as Float32Array;
  return new Cache(load, Math.max(LEAST_KEPT, Math.floor(KEPT_BYTES / Math.max(1, bytes))));
}

/**
 * Asks for frames ahead of the playback: the slower the server is, the farther ahead, and the more
 * sparsely.
 */
class Lookahead {
  private latencyS = 0.05;

  constructor(
    private readonly nFrames: number,
    private readonly framesPerSecond: number,
  ) {}

  /** Asks for the frames that can arrive before they are shown, as far as there is room. */
  prefetch<T>(
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
