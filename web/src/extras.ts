// What comes one frame at a time beside the modes: values of a heat map, and the original.

import { Lookahead } from "./ahead";
import { Cache } from "./cache";
import { loadPacket } from "./data";
import type { Picture } from "./picture";
import { playingFps, type Reel } from "./reel";

const KEPT_BYTES = 128e6;
const LEAST_KEPT = 8;

export class Extras {
  heatKind: string | null = null;
  isPerFrameRange = false;
  /** The value that is painted hottest. */
  hottest = 0;
  private readonly originals: Cache<Float32Array>;
  private readonly heats = new Map<string, Cache<Float32Array>>();
  private readonly ahead: Lookahead;
  private shownOriginal = -1;
  private shownHeat = "";

  constructor(
    private readonly reel: Reel,
    private readonly picture: Picture,
  ) {
    this.originals = frameCache("api/original", "positions", [reel.n_verts, 3]);
    this.ahead = new Lookahead(reel.n_frames, playingFps(reel));
  }

  /** Says that heat must be painted anew, since its kind or its range is another. */
  forgetHeat(): void {
    this.shownHeat = "";
    if (this.heatKind === null) this.picture.setHeat(null);
  }

  /** Fetches what a frame needs. */
  async load(frame: number): Promise<void> {
    await Promise.all([
      this.heatCache()?.load(frame),
      this.picture.needsOriginal ? this.originals.load(frame) : null,
    ]);
  }

  /** Fetches what the frames after this one need, while it plays. */
  foresee(frame: number, speed: number, failed: (error: unknown) => void): void {
    const heats = this.heatCache();
    if (heats) this.ahead.foresee(heats, frame, speed, failed);
    if (this.picture.needsOriginal) this.ahead.foresee(this.originals, frame, speed, failed);
  }

  /** Shows what is here of a frame; the rest stays as it was. True if anything has changed. */
  show(frame: number): boolean {
    const showsHeat = this.showHeat(frame);
    return this.showOriginal(frame) || showsHeat;
  }

  /** Whether all that is shown is of this frame. */
  areOf(frame: number): boolean {
    const isHeatRight = this.heatKind === null || this.shownHeat === this.heatKey(frame);
    return isHeatRight && (!this.picture.needsOriginal || this.shownOriginal === frame);
  }

  private showHeat(frame: number): boolean {
    const values = this.heatCache()?.peek(frame);
    if (!values || this.heatKey(frame) === this.shownHeat) return false;
    this.hottest = this.isPerFrameRange ? largest(values) : this.fixedRange();
    this.picture.setHeat({ values, hottest: this.hottest });
    this.shownHeat = this.heatKey(frame);
    return true;
  }

  private showOriginal(frame: number): boolean {
    const positions = this.picture.needsOriginal ? this.originals.peek(frame) : undefined;
    if (!positions || frame === this.shownOriginal) return false;
    this.picture.setOriginal(positions);
    this.shownOriginal = frame;
    return true;
  }

  private heatKey(frame: number): string {
    return `${this.heatKind} ${frame}`;
  }

  private heatCache(): Cache<Float32Array> | null {
    const kind = this.heatKind;
    if (kind === null) return null;
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

function largest(values: Float32Array): number {
  return values.reduce((most, value) => (value > most ? value : most), 0);
}
