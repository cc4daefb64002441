// Data that come one frame at a time beside the animation: the original, and from it the values of
// a heat map, which a worker computes: of all modes ahead of the playback, of few as they are shown.

import { Cache } from "./cache";
import { openOriginals, type Originals } from "./data";
import { heatsOf, isOfTrack, playingFps, type Reel } from "./facts";
import type { TrackValues } from "meshreel";

import { largest, type FrameErrors } from "./heat/fields";
import type { Answer } from "./heat/messages";
import { Measurer } from "./heat/measurer";
import { trackErrors } from "./heat/track_errors";
import type { Picture } from "./picture";

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
  /** Values of the track that colours the original. */
  private originalValues: Cache<TrackValues> | null = null;
  private readonly heats = new Map<string, Cache<Float32Array>>();
  private readonly ahead: Lookahead;
  private opened: Promise<Originals> | null = null;
  private measurer: Measurer | null = null;
  private shownOriginal = -1;
  private shownValues = -1;
  private shownHeat = "";
  /** What is being measured of few modes. */
  private measuring = "";
  /** The largest value of few modes so far, of which kind and how many. */
  private seen = { key: "", largest: 0 };

  /** `measured` is called when errors of few modes are there. */
  constructor(
    private readonly reel: Reel,
    private readonly picture: Picture,
    private readonly measured: () => void,
    private readonly failed: (error: unknown) => void,
  ) {
    this.originals = new Cache(async (frame) => (await this.source()).frame(frame), this.nKept(3));
    this.ahead = new Lookahead(reel.file.info.nFrames, playingFps(reel));
  }

  /** Has heat painted anew, since its kind or its range has changed. */
  forgetHeat(): void {
    this.shownHeat = "";
    if (this.heatKind === null) this.picture.setHeat(null);
  }

  /** Colours the original by a track of its own; null: by none. To be called when that changes. */
  setTrack(track: string | null): void {
    const isThere = track !== null && this.reel.original?.tracks.includes(track);
    this.shownValues = -1;
    this.originalValues = null;
    if (!isThere) return;
    const { nItems, nColumns } = this.reel.file.track(track).info;
    const load = async (frame: number) => (await this.source()).values(track, frame);
    this.originalValues = new Cache(load, keptFrames(2 * nItems * nColumns));
  }

  /** Fetches the data of a frame; of few modes, of the frame that is shown. */
  async load(frame: number): Promise<void> {
    await Promise.all([
      this.heatCache()?.load(frame),
      this.needsOriginal ? this.originals.load(frame) : null,
      this.neededValues?.load(frame),
    ]);
    if (this.comparesFew && this.heatKey(frame) !== this.shownHeat) await this.measureFew(frame);
  }

  /** Fetches the data of the frames after this one, while it plays. */
  prefetch(frame: number, speed: number): void {
    const heats = this.heatCache();
    if (heats) this.ahead.prefetch(heats, frame, speed, this.failed);
    if (this.needsOriginal) this.ahead.prefetch(this.originals, frame, speed, this.failed);
    if (this.neededValues) this.ahead.prefetch(this.neededValues, frame, speed, this.failed);
  }

  /** Shows the data of a frame that are here; the rest stays. True if anything has changed. */
  show(frame: number): boolean {
    if (this.comparesFew) void this.measureFew(frame).catch(this.failed);
    const showsHeat = !this.comparesFew && this.showHeat(frame);
    const showsValues = this.showValues(frame);
    return this.showOriginal(frame) || showsHeat || showsValues;
  }

  /** Whether all that is shown is of this frame. */
  areOf(frame: number): boolean {
    const isPainted = this.heatKind !== null || this.comparesFew;
    const isHeatRight = !isPainted || this.shownHeat === this.heatKey(frame);
    const areValuesRight = !this.neededValues || this.shownValues === frame;
    const isOriginalRight = !this.picture.needsOriginal || this.shownOriginal === frame;
    return isHeatRight && areValuesRight && isOriginalRight;
  }

  private source(): Promise<Originals> {
    return (this.opened ??= openOriginals(this.reel));
  }

  /** Values that are wanted now; null: none. */
  private get neededValues(): Cache<TrackValues> | null {
    return this.picture.showsOriginal ? this.originalValues : null;
  }

  private get comparesFew(): boolean {
    return this.fewModes !== null && this.reel.original !== null && !isOfTrack(this.heatKind);
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

  /** Measures the shown frame, if its original is here, and shows that unless it is too late. */
  private async measureFew(frame: number): Promise<void> {
    const [original, key] = [this.originals.peek(frame), this.heatKey(frame)];
    if (!original || key === this.shownHeat || this.measuring !== "") return;
    this.measuring = key;
    let answer: Answer;
    try {
      answer = await this.measure(this.heatKind, original, this.picture.positions());
    } finally {
      this.measuring = "";
    }
    if (key !== this.heatKey(frame)) return;
    this.frameErrors = { frame, ...answer.errors };
    this.shownHeat = key;
    const { values } = answer;
    if (values) this.paint(values, this.rangeOfFew(largest(values)), frame);
    this.measured();
  }

  private measure(
    kind: string | null,
    original: Float32Array,
    decoded: Float32Array,
  ): Promise<Answer> {
    const { file, original: info } = this.reel;
    this.measurer ??= new Measurer({
      triangles: file.surface.triangles,
      nVerts: file.info.nVerts,
      diagonal: info?.diagonal ?? file.info.diagonal,
    });
    return this.measurer.measure(kind, original, decoded);
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

  private showValues(frame: number): boolean {
    const values = this.neededValues?.peek(frame);
    if (!values || frame === this.shownValues) return false;
    this.picture.setOriginalValues(values);
    this.shownValues = frame;
    return true;
  }

  private heatKey(frame: number): string {
    return `${this.heatKind} ${this.fewModes} ${frame}`;
  }

  /** Values of all modes; null where they are not shown. */
  private heatCache(): Cache<Float32Array> | null {
    const kind = this.heatKind;
    if (kind === null || this.comparesFew) return null;
    const cache =
      this.heats.get(kind) ?? new Cache((frame) => this.heatOf(kind, frame), this.nKept(1));
    this.heats.set(kind, cache);
    return cache;
  }

  private async heatOf(kind: string, frame: number): Promise<Float32Array> {
    if (isOfTrack(kind)) return this.errorsOfTrack(kind, frame);
    const { center } = this.reel.file.info;
    const [original, positions] = await Promise.all([
      this.originals.load(frame),
      this.reel.file.frame(frame),
    ]);
    const decoded = Float32Array.from(positions, (value, i) => value - center[i % 3]);
    const { values } = await this.measure(kind, original, decoded);
    return values as Float32Array;
  }

  private async errorsOfTrack(kind: string, frame: number): Promise<Float32Array> {
    const { file, original } = this.reel;
    const { track } = original?.track_heats.find((heat) => heat.kind === kind) as { track: string };
    const [given, decoded] = await Promise.all([
      this.source().then((source) => source.values(track, frame)),
      file.track(track).frame(frame),
    ]);
    return trackErrors(file.track(track).info, file.surface, file.info.nVerts, given, decoded);
  }

  /** Frames of so many numbers for each vertex that are kept. */
  private nKept(width: number): number {
    return keptFrames(width * this.reel.file.info.nVerts);
  }

  private fixedRange(): number {
    const { original } = this.reel;
    const info = original && heatsOf(original).find((heat) => heat.kind === this.heatKind);
    return info?.range || info?.maximum || 1;
  }
}

/** Frames of so many numbers that are kept. */
function keptFrames(nNumbers: number): number {
  return Math.max(LEAST_KEPT, Math.floor(KEPT_BYTES / (4 * Math.max(1, nNumbers))));
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
