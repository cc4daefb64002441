// Playback: loads data of the current frame, and redraws when something has changed.

import { CorruptStreamError, TruncatedStreamError } from "../index.js";
import type { ColorLegend, ReelMesh } from "../three/index.js";

import { FrameData } from "./frame_data.js";
import { maxModes, type Reel } from "./facts.js";
import type { FrameErrors } from "./heat/error_fields.js";
import type { Picture } from "./picture.js";
import type { TrackSettings } from "./tracks/settings.js";

export interface PlayerState {
  frame: number;
  playing: boolean;
  buffering: boolean;
  modes: number;
  /** Whether fewer modes than all are shown. */
  isFew: boolean;
  /** Errors of the shown frame with reduced modes, if there is an original. */
  frameErrors: (FrameErrors & { frame: number }) | null;
  heat: string | null;
  hottest: number;
  speed: number;
  loop: boolean;
  smoothPlay: boolean;
  perFrameRange: boolean;
  drawMs: number;
}

/** Controls playback of the page. */
export class Player {
  /** Called when anything in `state()` may have changed. */
  onChange: () => void = () => {};
  onError: (error: unknown) => void = () => {};
  private nModes: number;
  private isDirty = true;
  private isMeasuring = false;
  private nDrawn = 0;
  private drawMs = 0;
  private lastMs = 0;
  private readonly mesh: ReelMesh;
  private readonly extras: FrameData;
  private loadingFrameData: Promise<void> | null = null;

  constructor(
    private readonly reel: Reel,
    private readonly picture: Picture,
  ) {
    this.mesh = picture.mesh;
    this.mesh.interpolate = false;
    this.nModes = maxModes(reel);
    const markDirty = () => {
      this.isDirty = true;
      this.onChange();
    };
    this.extras = new FrameData(reel, picture, markDirty, (error) => this.fail(error));
    this.mesh.addEventListener("frame", markDirty);
    this.mesh.addEventListener("waiting", () => this.onChange());
    this.mesh.addEventListener("playing", () => this.onChange());
    this.mesh.addEventListener("ended", () => this.pause());
    this.mesh.addEventListener("warning", ({ message }) => this.onError(new Error(message)));
    this.mesh.addEventListener("error", ({ error, block, frames }) =>
      this.reportError(error, frames ?? (block === null ? null : this.mesh.reel.info.blocks[block])),
    );
    requestAnimationFrame((now) => this.tick(now));
  }

  get frame(): number {
    return this.mesh.frame;
  }

  get isPlaying(): boolean {
    return this.mesh.isPlaying;
  }

  get isLooping(): boolean {
    return this.mesh.loop === "repeat";
  }

  set isLooping(isLooping: boolean) {
    this.mesh.loop = isLooping ? "repeat" : "once";
  }

  set speed(speed: number) {
    this.mesh.speed = speed;
  }

  state(): PlayerState {
    const { mesh, extras } = this;
    return {
      frame: mesh.frame,
      playing: mesh.isPlaying,
      buffering: mesh.isWaiting,
      modes: this.nModes,
      isFew: extras.reducedModes !== null,
      frameErrors: extras.frameErrors,
      heat: extras.heatKind,
      hottest: extras.heatMaximum,
      speed: mesh.speed,
      loop: this.isLooping,
      smoothPlay: mesh.interpolate,
      perFrameRange: extras.isPerFrameRange,
      drawMs: this.drawMs,
    };
  }

  play(): void {
    this.mesh.play();
    this.onChange();
  }

  pause(): void {
    this.mesh.pause();
    void this.seek(this.mesh.frame).catch(this.onError);
  }

  /** Show a frame with its heat map and original; resolves once it is drawn. */
  async seek(frame: number): Promise<void> {
    const last = this.reel.segments.info.nFrames - 1;
    this.mesh.seek({ frame: Math.min(Math.max(0, Math.round(frame)), last) });
    await this.show();
  }

  setModes(nModes: number): void {
    const maxCount = maxModes(this.reel);
    this.nModes = Math.min(Math.max(1, Math.round(nModes)), maxCount);
    const hasReducedModes = this.nModes < maxCount;
    this.extras.reducedModes = hasReducedModes ? this.nModes : null;
    this.mesh.modes = hasReducedModes ? this.nModes : Infinity;
    this.redraw();
  }

  /** The track that colors the mesh, or will once it is loaded. */
  private track: string | null = null;

  get hasTrack(): boolean {
    return this.track !== null;
  }

  /** Whether the original lacks the track that colors the mesh. */
  get isTrackMissing(): boolean {
    const { original } = this.reel;
    return this.track !== null && original !== null && !original.tracks.includes(this.track);
  }

  /** Color the mesh by a track in place of a heat map; null: none. */
  async setTrack(look: TrackSettings | null): Promise<ColorLegend | null> {
    this.track = look?.track ?? null;
    if (look) {
      this.extras.heatKind = null;
      this.extras.invalidateHeat();
    }
    this.extras.setTrack(null);
    const legend = await this.picture.setTrack(look).catch((error: Error) => {
      if (error.name !== "AbortError") throw error;
      return null;
    });
    this.extras.setTrack(legend?.name ?? null);
    await this.show();
    return legend;
  }

  async setHeat(kind: string | null): Promise<void> {
    if (kind !== null && this.hasTrack) await this.setTrack(null);
    this.extras.heatKind = kind;
    this.extras.invalidateHeat();
    await this.show();
  }

  async setPerFrameRange(isPerFrame: boolean): Promise<void> {
    this.extras.isPerFrameRange = isPerFrame;
    this.extras.invalidateHeat();
    await this.show();
  }

  setSmoothPlay(isSmooth: boolean): void {
    this.mesh.interpolate = isSmooth;
    this.redraw();
  }

  /** Schedule a redraw with all data that the current look needs. */
  redraw(): void {
    this.isDirty = true;
    if (!this.isPlaying) void this.loadFrameData().then(() => this.onChange(), this.onError);
    this.onChange();
  }

  /** Draw synchronously, such as to read the canvas afterwards. */
  drawNow(): void {
    const started = performance.now();
    this.picture.draw();
    this.isDirty = false;
    this.nDrawn++;
    this.drawMs = performance.now() - started;
  }

  /** Read the drawn positions (V, 3) back from the GPU, in model units. */
  positions(): Float32Array {
    const { center } = this.reel.file.info;
    return this.picture.positions().map((value, i) => value + center[i % 3]);
  }

  /** Measure the rate of redraws during playback, in frames per second. */
  async measureFps(seconds: number): Promise<number> {
    await this.show();
    this.isMeasuring = true;
    this.play();
    const started = performance.now();
    this.nDrawn = 0;
    await new Promise((resolve) => setTimeout(resolve, 1000 * seconds));
    this.picture.positions(); // waits for the GPU
    const rate = (1000 * this.nDrawn) / (performance.now() - started);
    this.isMeasuring = false;
    this.pause();
    return rate;
  }

  private async show(): Promise<void> {
    this.onChange();
    await this.waitUntilReady();
    await this.loadFrameData();
    this.drawNow();
    this.onChange();
  }

  /** Wait until the current frame is available, or its block turns out to be damaged. */
  private async waitUntilReady(): Promise<void> {
    const { mesh } = this;
    while (mesh.isWaiting) {
      await new Promise<void>((resolve, reject) => {
        const end = (error?: Error) => {
          mesh.removeEventListener("frame", shown);
          mesh.removeEventListener("error", onError);
          if (error) reject(error);
          else resolve();
        };
        const shown = () => end();
        const onError = ({ error }: { error: Error }) => end(isDamageError(error) ? undefined : error);
        mesh.addEventListener("frame", shown);
        mesh.addEventListener("error", onError);
      });
    }
  }

  // Only one load at a time, then the latest frame: dragging the timeline must not flood the server.
  private async loadFrameData(): Promise<void> {
    this.loadingFrameData ??= this.loadCurrentFrame().finally(() => (this.loadingFrameData = null));
    await this.loadingFrameData;
    if (!this.isPlaying && !this.mesh.isWaiting && !this.extras.isCurrent(this.frame)) {
      await this.loadFrameData();
    }
  }

  private async loadCurrentFrame(): Promise<void> {
    await this.extras.load(this.frame);
    this.extras.show(this.frame);
    this.isDirty = true;
  }

  private tick(nowMs: number): void {
    requestAnimationFrame((now) => this.tick(now));
    const seconds = (nowMs - this.lastMs) / 1000;
    this.lastMs = nowMs;
    try {
      if (this.isPlaying) this.advance(seconds);
      if (this.isDirty || this.isMeasuring) this.drawNow();
    } catch (error) {
      this.fail(error);
    }
  }

  private advance(seconds: number): void {
    this.mesh.update(seconds);
    this.extras.prefetch(this.frame, this.mesh.speed);
    if (this.extras.show(this.frame)) this.isDirty = true;
  }

  private fail(error: unknown): void {
    this.mesh.pause();
    this.onError(error);
    this.onChange();
  }

  /** Report an error; playback skips damaged blocks and stops for other errors. */
  private reportError(error: Error, range: { start: number; nFrames: number } | null): void {
    if (!range) return this.onError(error); // a material image or a texture
    if (!isDamageError(error)) return this.fail(error);
    const { start, nFrames } = range;
    const frames = `Frames ${start} to ${start + nFrames - 1} are damaged and left out`;
    this.onError(new Error(`${frames}: ${error.message}`));
  }
}

function isDamageError(error: Error): boolean {
  return error instanceof CorruptStreamError || error instanceof TruncatedStreamError;
}
