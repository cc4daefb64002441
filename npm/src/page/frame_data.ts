// Per-frame data besides the animation: the original, and heat maps, which a worker computes. With all
// modes they are prefetched; with fewer modes they are computed for the shown frame.

import { Cache } from "./cache.js";
import { openOriginals, type Originals } from "./data.js";
import { allHeats, isTrackHeat, playbackFps, type Reel } from "./facts.js";
import type { TrackValues } from "../index.js";

import { maxFinite, type FrameErrors } from "./heat/error_fields.js";
import type { ErrorResponse } from "./heat/messages.js";
import { ErrorWorker } from "./heat/error_worker.js";
import { trackErrors } from "./heat/track_errors.js";
import type { Picture } from "./picture.js";

const CACHE_BYTES = 128e6;
const MIN_CACHED_FRAMES = 8;
const MAX_PARALLEL = 3;

/** Loads and shows the original, heat maps and track values of frames. */
export class FrameData {
  heatKind: string | null = null;
  isPerFrameRange = false;
  /** Upper end of the heat map. */
  heatMaximum = 0;
  /** Number of shown modes; null if all are shown. */
  reducedModes: number | null = null;
  /** Errors of the frame that is shown with fewer modes than all. */
  frameErrors: (FrameErrors & { frame: number }) | null = null;
  private readonly originals: Cache<Float32Array>;
  /** Values of the track that colors the original. */
  private originalValues: Cache<TrackValues> | null = null;
  private readonly heats = new Map<string, Cache<Float32Array>>();
  private readonly lookahead: Lookahead;
  private opened: Promise<Originals> | null = null;
  private measurer: ErrorWorker | null = null;
  private shownOriginal = -1;
  private shownValues = -1;
  private shownHeat = "";
  /** Key of the measurement with reduced modes that is running. */
  private measuring = "";
  /** Largest value so far with reduced modes, by heat map and number of modes. */
  private observedRange = { key: "", largest: 0 };

  /** @param onMeasured - called when errors with reduced modes are available */
  constructor(
    private readonly reel: Reel,
    private readonly picture: Picture,
    private readonly onMeasured: () => void,
    private readonly failed: (error: unknown) => void,
  ) {
    this.originals = new Cache(async (frame) => (await this.source()).frame(frame), this.frameCapacity(3));
    this.lookahead = new Lookahead(reel.file.info.nFrames, playbackFps(reel));
  }

  /** Repaint the heat map, since its kind or range has changed. */
  invalidateHeat(): void {
    this.shownHeat = "";
    if (this.heatKind === null) this.picture.setHeat(null);
  }

  /** Set the track that colors the original; null: none. */
  setTrack(track: string | null): void {
    const hasTrack = track !== null && this.reel.original?.tracks.includes(track);
    this.shownValues = -1;
    this.originalValues = null;
    if (!hasTrack) return;
    const { nItems, nColumns } = this.reel.file.track(track).info;
    const load = async (frame: number) => (await this.source()).values(track, frame);
    this.originalValues = new Cache(load, frameCount(2 * nItems * nColumns));
  }

  /** Load the data of a frame. */
  async load(frame: number): Promise<void> {
    await Promise.all([
      this.heatCache()?.load(frame),
      this.needsOriginal ? this.originals.load(frame) : null,
      this.neededValues?.load(frame),
    ]);
    if (this.measuresReducedModes && this.heatKey(frame) !== this.shownHeat) await this.measureReducedModes(frame);
  }

  /** Prefetch data of upcoming frames during playback. */
  prefetch(frame: number, speed: number): void {
    const heats = this.heatCache();
    if (heats) this.lookahead.prefetch(heats, frame, speed, this.failed);
    if (this.needsOriginal) this.lookahead.prefetch(this.originals, frame, speed, this.failed);
    if (this.neededValues) this.lookahead.prefetch(this.neededValues, frame, speed, this.failed);
  }

  /** Show the data of a frame that are loaded; returns whether anything has changed. */
  show(frame: number): boolean {
    if (this.measuresReducedModes) void this.measureReducedModes(frame).catch(this.failed);
    const showsHeat = !this.measuresReducedModes && this.showHeat(frame);
    const showsValues = this.showValues(frame);
    return this.showOriginal(frame) || showsHeat || showsValues;
  }

  /** Whether all shown data belong to this frame. */
  isCurrent(frame: number): boolean {
    const isPainted = this.heatKind !== null || this.measuresReducedModes;
    const isHeatRight = !isPainted || this.shownHeat === this.heatKey(frame);
    const areValuesRight = !this.neededValues || this.shownValues === frame;
    const isOriginalRight = !this.picture.needsOriginal || this.shownOriginal === frame;
    return isHeatRight && areValuesRight && isOriginalRight;
  }

  private source(): Promise<Originals> {
    return (this.opened ??= openOriginals(this.reel));
  }

  /** Track values that are currently needed, or null. */
  private get neededValues(): Cache<TrackValues> | null {
    return this.picture.showsOriginal ? this.originalValues : null;
  }

  private get measuresReducedModes(): boolean {
    return this.reducedModes !== null && this.reel.original !== null && !isTrackHeat(this.heatKind);
  }

  private get needsOriginal(): boolean {
    return this.picture.needsOriginal || this.measuresReducedModes;
  }

  private showHeat(frame: number): boolean {
    this.frameErrors = null;
    const values = this.heatCache()?.peek(frame);
    if (!values || this.heatKey(frame) === this.shownHeat) return false;
    this.paint(values, this.fixedRange(), frame);
    return true;
  }

  /** Measure the shown frame if its original is loaded, and show the result unless it is outdated. */
  private async measureReducedModes(frame: number): Promise<void> {
    const [original, key] = [this.originals.peek(frame), this.heatKey(frame)];
    if (!original || key === this.shownHeat || this.measuring !== "") return;
    this.measuring = key;
    let answer: ErrorResponse;
    try {
      answer = await this.measure(this.heatKind, original, this.picture.positions());
    } finally {
      this.measuring = "";
    }
    if (key !== this.heatKey(frame)) return;
    this.frameErrors = { frame, ...answer.errors };
    this.shownHeat = key;
    const { values } = answer;
    if (values) this.paint(values, this.reducedModesRange(maxFinite(values)), frame);
    this.onMeasured();
  }

  private measure(
    kind: string | null,
    original: Float32Array,
    decoded: Float32Array,
  ): Promise<ErrorResponse> {
    const { file, original: info } = this.reel;
    this.measurer ??= new ErrorWorker({
      triangles: file.surface.triangles,
      nVerts: file.info.nVerts,
      diagonal: info?.diagonal ?? file.info.diagonal,
    });
    return this.measurer.measure(kind, original, decoded);
  }

  private paint(values: Float32Array, range: number, frame: number): void {
    this.heatMaximum = this.isPerFrameRange ? maxFinite(values) : range;
    this.picture.setHeat({ values, heatMaximum: this.heatMaximum });
    this.shownHeat = this.heatKey(frame);
  }

  /** Range with all modes, extended by the values with reduced modes so far. */
  private reducedModesRange(value: number): number {
    const key = `${this.heatKind} ${this.reducedModes}`;
    if (key !== this.observedRange.key) this.observedRange = { key, largest: 0 };
    this.observedRange.largest = Math.max(this.observedRange.largest, value);
    return Math.max(this.observedRange.largest, this.fixedRange());
  }

  private showOriginal(frame: number): boolean {
    const positions = this.picture.needsOriginal ? this.originals.peek(frame) : undefined;
    if (!positions || frame === this.shownOriginal) return false;
    this.picture.setOriginal(positions);
    this.shownOriginal = frame;
    return true;
  }

  private showValues(frame: number): boolean {
    const values = this.neededValues?.peek(frame);
    if (!values || frame === this.shownValues) return false;
    this.picture.setOriginalValues(values);
    this.shownValues = frame;
    return true;
  }

  private heatKey(frame: number): string {
    return `${this.heatKind} ${this.reducedModes} ${frame}`;
  }

  /** Heat maps with all modes; null if they are not shown. */
  private heatCache(): Cache<Float32Array> | null {
    const kind = this.heatKind;
    if (kind === null || this.measuresReducedModes) return null;
    const cache =
      this.heats.get(kind) ?? new Cache((frame) => this.computeHeat(kind, frame), this.frameCapacity(1));
    this.heats.set(kind, cache);
    return cache;
  }

  private async computeHeat(kind: string, frame: number): Promise<Float32Array> {
    if (isTrackHeat(kind)) return this.trackErrorsOf(kind, frame);
    const { center } = this.reel.file.info;
    const [original, positions] = await Promise.all([
      this.originals.load(frame),
      this.reel.file.frame(frame),
    ]);
    const decoded = Float32Array.from(positions, (value, i) => value - center[i % 3]);
    const { values } = await this.measure(kind, original, decoded);
    return values as Float32Array;
  }

  private async trackErrorsOf(kind: string, frame: number): Promise<Float32Array> {
    const { file, original } = this.reel;
    const { track } = original?.track_heats.find((heat) => heat.kind === kind) as { track: string };
    const [given, decoded] = await Promise.all([
      this.source().then((source) => source.values(track, frame)),
      file.track(track).frame(frame),
    ]);
    return trackErrors(file.track(track).info, file.surface, file.info.nVerts, given, decoded);
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
