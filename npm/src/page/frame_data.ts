// Per-frame data besides the animation: the original, and heat maps.

import { Cache } from "./cache.js";
import { openOriginals, type Originals } from "./data.js";
import { allHeats, isTrackHeat, type Reel } from "./facts.js";
import type { TrackValues } from "../index.js";
import { DEFAULT_FPS } from "../three/playback.js";

import { type ErrorKind, maxFinite, vertexErrors } from "./heat/error_fields.js";
import { trackErrors } from "./heat/track_errors.js";
import type { Picture } from "./picture.js";

const CACHE_BYTES = 128e6;
const MIN_CACHED_FRAMES = 8;
const MAX_PARALLEL = 3;

/** Per-frame data that the current appearance needs. */
interface Layer<T> {
  readonly name: "heat" | "original" | "values";
  readonly cache: Cache<T>;
  show(data: T): void;
}

/** Loads and shows the original, heat maps and track values of frames. */
export class FrameData {
  heatKind: string | null = null;
  isPerFrameRange = false;
  /** Upper end of the heat map. */
  heatMaximum = 0;
  private readonly originals: Cache<Float32Array>;
  /** Values of the track that colors the original. */
  private originalValues: Cache<TrackValues> | null = null;
  private readonly heats = new Map<string, Cache<Float32Array>>();
  private readonly lookahead: Lookahead;
  private opened: Promise<Originals> | null = null;
  /** The frame that each layer shows. */
  private readonly shown = new Map<Layer<unknown>["name"], number>();

  constructor(
    private readonly reel: Reel,
    private readonly picture: Picture,
    private readonly failed: (error: unknown) => void,
  ) {
    this.originals = new Cache(async (frame) => (await this.source()).frame(frame), this.frameCapacity(3));
    this.lookahead = new Lookahead(reel.file.info.nFrames, reel.file.info.fps || DEFAULT_FPS);
  }

  /** Repaint the heat map, since its kind or range has changed. */
  invalidateHeat(): void {
    this.shown.delete("heat");
    if (this.heatKind === null) this.picture.setHeat(null);
  }

  /** Set the track that colors the original; null: none. */
  setTrack(track: string | null): void {
    const hasTrack = track !== null && this.reel.original?.tracks.includes(track);
    this.shown.delete("values");
    this.originalValues = null;
    if (!hasTrack) return;
    const { nItems, nColumns } = this.reel.file.track(track).info;
    const load = async (frame: number) => (await this.source()).values(track, frame);
    this.originalValues = new Cache(load, frameCount(2 * nItems * nColumns));
  }

  /** Load the data of a frame. */
  async load(frame: number): Promise<void> {
    await Promise.all(this.layers().map(({ cache }) => cache.load(frame)));
  }

  /** Prefetch data of upcoming frames during playback. */
  prefetch(frame: number, speed: number): void {
    for (const { cache } of this.layers()) this.lookahead.prefetch(cache, frame, speed, this.failed);
  }

  /** Show the loaded data of a frame. */
  show(frame: number): void {
    for (const { name, cache, show } of this.layers()) {
      const data = cache.peek(frame);
      if (data === undefined || this.shown.get(name) === frame) continue;
      show(data);
      this.shown.set(name, frame);
    }
  }

  /** Whether all shown data belong to this frame. */
  isCurrent(frame: number): boolean {
    return this.layers().every(({ name }) => this.shown.get(name) === frame);
  }

  private layers(): Layer<any>[] {
    const { heatKind: kind, picture, originals, originalValues } = this;
    const layers: Layer<any>[] = [];
    if (kind !== null) layers.push({ name: "heat", cache: this.heatCache(kind), show: (values) => this.paint(values) });
    if (picture.needsOriginal) {
      layers.push({ name: "original", cache: originals, show: (positions) => picture.setOriginal(positions) });
    }
    if (picture.showsOriginal && originalValues) {
      layers.push({ name: "values", cache: originalValues, show: (values) => picture.setOriginalValues(values) });
    }
    return layers;
  }

  private source(): Promise<Originals> {
    return (this.opened ??= openOriginals(this.reel));
  }

  private paint(values: Float32Array): void {
    this.heatMaximum = this.isPerFrameRange ? maxFinite(values) : this.fixedRange();
    this.picture.setHeat({ values, heatMaximum: this.heatMaximum });
  }

  private heatCache(kind: string): Cache<Float32Array> {
    const cache =
      this.heats.get(kind) ?? new Cache((frame) => this.computeHeat(kind, frame), this.frameCapacity(1));
    this.heats.set(kind, cache);
    return cache;
  }

  private async computeHeat(kind: string, frame: number): Promise<Float32Array> {
    if (isTrackHeat(kind)) return this.trackErrorsOf(kind, frame);
    const { file, original: info } = this.reel;
    const { center } = file.info;
    const [original, positions] = await Promise.all([this.originals.load(frame), file.frame(frame)]);
    const decoded = Float32Array.from(positions, (value, i) => value - center[i % 3]);
    const diagonal = info?.diagonal ?? file.info.diagonal;
    return vertexErrors(kind as ErrorKind, file.surface.triangles, diagonal, original, decoded);
  }

  private async trackErrorsOf(kind: string, frame: number): Promise<Float32Array> {
    const { file, original: info } = this.reel;
    const { track } = info?.track_heats.find((heat) => heat.kind === kind) as { track: string };
    const [original, decoded] = await Promise.all([
      this.source().then((source) => source.values(track, frame)),
      file.track(track).frame(frame),
    ]);
    return trackErrors(file.track(track).info, file.surface, file.info.nVerts, original, decoded);
  }

  /** Number of cached frames with `width` numbers per vertex. */
  private frameCapacity(width: number): number {
    return frameCount(width * this.reel.file.info.nVerts);
  }

  private fixedRange(): number {
    const { original } = this.reel;
    const info = original && allHeats(original).find((heat) => heat.kind === this.heatKind);
    return info?.range || info?.maximum || 1;
  }
}

/** Number of cached frames with `nNumbers` numbers. */
function frameCount(nNumbers: number): number {
  return Math.max(MIN_CACHED_FRAMES, Math.floor(CACHE_BYTES / (4 * Math.max(1, nNumbers))));
}

/**
 * Prefetches frames during playback. With a slower server it looks farther ahead, and skips more
 * frames.
 */
class Lookahead {
  private latencyS = 0.05;

  constructor(
    private readonly nFrames: number,
    private readonly framesPerSecond: number,
  ) {}

  /** Request frames that can arrive before they are shown, within the limit of parallel requests. */
  prefetch<T>(
    cache: Cache<T>,
    shown: number,
    speed: number,
    failed: (error: unknown) => void,
  ): void {
    const rate = this.framesPerSecond * speed;
    const stride = Math.max(1, Math.ceil((this.latencyS * rate) / MAX_PARALLEL));
    const lead = Math.ceil(this.latencyS * rate) + 1;
    let next = Math.ceil((shown + lead) / stride) * stride;
    for (let tries = 0; tries < MAX_PARALLEL && cache.nLoading < MAX_PARALLEL; tries++, next += stride) {
      const frame = next % this.nFrames;
      if (!cache.hasOrLoads(frame)) void this.measureLatency(cache.load(frame)).catch(failed);
    }
  }

  private async measureLatency(loading: Promise<unknown>): Promise<void> {
    const started = performance.now();
    await loading;
    const seconds = (performance.now() - started) / 1000;
    this.latencyS += 0.2 * (seconds - this.latencyS);
  }
}
