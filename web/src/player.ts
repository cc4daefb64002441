// Plays: has the data of the frame fetched that is due, and draws when something has changed.

import { CorruptStreamError, TruncatedStreamError } from "meshreel";
import type { ColorLegend, ReelMesh } from "meshreel/three";

import { Extras } from "./extras";
import { mostModes, type Reel } from "./facts";
import type { FrameErrors } from "./heat/fields";
import type { Picture } from "./picture";
import type { TrackLook } from "./tracks/look";

export interface PlayerState {
  frame: number;
  playing: boolean;
  buffering: boolean;
  modes: number;
  /** Whether fewer modes are shown than there are. */
  isFew: boolean;
  /** Of the shown frame of few modes, where there is an original. */
  frameErrors: (FrameErrors & { frame: number }) | null;
  heat: string | null;
  hottest: number;
  speed: number;
  loop: boolean;
  smoothPlay: boolean;
  perFrameRange: boolean;
  drawMs: number;
}

export class Player {
  /** Called when anything in `state()` may have changed. */
  changed: () => void = () => {};
  failed: (error: unknown) => void = () => {};
  private nModes: number;
  private isDirty = true;
  private isMeasuring = false;
  private nDrawn = 0;
  private drawMs = 0;
  private lastMs = 0;
  private readonly mesh: ReelMesh;
  private readonly extras: Extras;
  private settling: Promise<void> | null = null;

  constructor(
    private readonly reel: Reel,
    private readonly picture: Picture,
  ) {
    this.mesh = picture.mesh;
    this.mesh.interpolate = false;
    this.nModes = mostModes(reel);
    const dirty = () => {
      this.isDirty = true;
      this.changed();
    };
    this.extras = new Extras(reel, picture, dirty, (error) => this.fail(error));
    this.mesh.addEventListener("frame", dirty);
    this.mesh.addEventListener("waiting", () => this.changed());
    this.mesh.addEventListener("playing", () => this.changed());
    this.mesh.addEventListener("ended", () => this.pause());
    this.mesh.addEventListener("warning", ({ message }) => this.failed(new Error(message)));
    this.mesh.addEventListener("error", ({ error, block }) => this.tell(error, block));
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
      isFew: extras.fewModes !== null,
      frameErrors: extras.frameErrors,
      heat: extras.heatKind,
      hottest: extras.hottest,
      speed: mesh.speed,
      loop: this.isLooping,
      smoothPlay: mesh.interpolate,
      perFrameRange: extras.isPerFrameRange,
      drawMs: this.drawMs,
    };
  }

  play(): void {
    this.mesh.play();
    this.changed();
  }

  pause(): void {
    this.mesh.pause();
    void this.seek(this.mesh.frame).catch(this.failed);
  }

  /** Shows a frame exactly, with its heat and original; resolves once it is drawn. */
  async seek(frame: number): Promise<void> {
    const last = this.reel.file.info.nFrames - 1;
    this.mesh.seek({ frame: Math.min(Math.max(0, Math.round(frame)), last) });
    await this.show();
  }

  setModes(nModes: number): void {
    const most = mostModes(this.reel);
    this.nModes = Math.min(Math.max(1, Math.round(nModes)), most);
    const isFew = this.nModes < most;
    this.extras.fewModes = isFew ? this.nModes : null;
    this.mesh.modes = isFew ? this.nModes : Infinity;
    this.redraw();
  }

  /** The track whose colours the mesh has, or will have. */
  private track: string | null = null;

  get hasTrack(): boolean {
    return this.track !== null;
  }

  /** Whether the original has not the track that colours the mesh. */
  get isTrackMissing(): boolean {
    const { original } = this.reel;
    return this.track !== null && original !== null && !original.tracks.includes(this.track);
  }

  /** Colours the mesh by a track, in place of a heat map; null: by none. */
  async setTrack(look: TrackLook | null): Promise<ColorLegend | null> {
    this.track = look?.track ?? null;
    if (look) {
      this.extras.heatKind = null;
      this.extras.forgetHeat();
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
    this.extras.forgetHeat();
    await this.show();
  }

  async setPerFrameRange(isPerFrame: boolean): Promise<void> {
    this.extras.isPerFrameRange = isPerFrame;
    this.extras.forgetHeat();
    await this.show();
  }

  setSmoothPlay(isSmooth: boolean): void {
    this.mesh.interpolate = isSmooth;
    this.redraw();
  }

  /** Draws again at the next occasion, with the data that the look needs now. */
  redraw(): void {
    this.isDirty = true;
    if (!this.isPlaying) void this.settle().then(() => this.changed(), this.failed);
    this.changed();
  }

  /** Draws at once, for a picture that is read from the canvas in the same moment. */
  drawNow(): void {
    const started = performance.now();
    this.picture.draw();
    this.isDirty = false;
    this.nDrawn++;
    this.drawMs = performance.now() - started;
  }

  /** Positions (V, 3) in model units as they are drawn, read back from the GPU. */
  positions(): Float32Array {
    const { center } = this.reel.file.info;
    return this.picture.positions().map((value, i) => value + center[i % 3]);
  }

  /** Frames presented per second, as fast as the machine draws them while it plays. */
  async measureFps(seconds: number): Promise<number> {
    await this.show();
    this.isMeasuring = true;
    this.play();
    const started = performance.now();
    this.nDrawn = 0;
    await new Promise((resolve) => setTimeout(resolve, 1000 * seconds));
    this.picture.positions(); // which waits until the GPU has done its work
    const rate = (1000 * this.nDrawn) / (performance.now() - started);
    this.isMeasuring = false;
    this.pause();
    return rate;
  }

  private async show(): Promise<void> {
    this.changed();
    await this.arrived();
    await this.settle();
    this.drawNow();
    this.changed();
  }

  /** Resolves when the picture of the time is there, or its block turns out to be damaged. */
  private async arrived(): Promise<void> {
    const { mesh } = this;
    while (mesh.isWaiting) {
      await new Promise<void>((resolve, reject) => {
        const end = (error?: Error) => {
          mesh.removeEventListener("frame", shown);
          mesh.removeEventListener("error", failed);
          if (error) reject(error);
          else resolve();
        };
        const shown = () => end();
        const failed = ({ error }: { error: Error }) => end(isDamage(error) ? undefined : error);
        mesh.addEventListener("frame", shown);
        mesh.addEventListener("error", failed);
      });
    }
  }

  // One at a time, and only for the frame that is wanted last: dragging does not flood the server.
  private async settle(): Promise<void> {
    this.settling ??= this.fetchShown().finally(() => (this.settling = null));
    await this.settling;
    if (!this.isPlaying && !this.mesh.isWaiting && !this.extras.areOf(this.frame)) {
      await this.settle();
    }
  }

  private async fetchShown(): Promise<void> {
    await this.extras.load(this.frame);
    this.extras.show(this.frame);
    this.isDirty = true;
  }

  private tick(nowMs: number): void {
    requestAnimationFrame((now) => this.tick(now));
    const seconds = (nowMs - this.lastMs) / 1000;
    this.lastMs = nowMs;
    try {
      if (this.isPlaying) this.playOn(seconds);
      if (this.isDirty || this.isMeasuring) this.drawNow();
    } catch (error) {
      this.fail(error);
    }
  }

  private playOn(seconds: number): void {
    this.mesh.update(seconds);
    this.extras.prefetch(this.frame, this.mesh.speed);
    if (this.extras.show(this.frame)) this.isDirty = true;
  }

  private fail(error: unknown): void {
    this.mesh.pause();
    this.failed(error);
    this.changed();
  }

  /** Says what cannot be shown: a damaged block is passed over, for anything else it stops. */
  private tell(error: Error, number: number | null): void {
    if (number === null) return this.failed(error); // an image of a material
    if (!isDamage(error)) return this.fail(error);
    const { start, nFrames } = this.reel.file.info.blocks[number];
    const frames = `Frames ${start} to ${start + nFrames - 1} are damaged and left out`;
    this.failed(new Error(`${frames}: ${error.message}`));
  }
}

function isDamage(error: Error): boolean {
  return error instanceof CorruptStreamError || error instanceof TruncatedStreamError;
}
