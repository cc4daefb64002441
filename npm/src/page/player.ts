// Playback on the page: loads heat map, original and track of the frame that <reel-player> shows.

import { partsOf, type PlayerParts, type ReelPlayerElement } from "../player/element.js";
import { isDamageError } from "../three/block_cache.js";
import type { ColorLegend } from "../three/color/track_colors.js";
import type { ReelMesh } from "../three/reel_mesh.js";

import type { CutPlane } from "../index.js";
import { FrameData } from "./frame_data.js";
import type { Reel, TrackSettings } from "./facts.js";
import { showError } from "./page.js";
import type { Picture } from "./picture.js";

export interface PlayerState {
  frame: number;
  playing: boolean;
  heat: string | null;
  hottest: number;
  perFrameRange: boolean;
}

/** Controls playback on the page. */
export class Player {
  /** Called when anything in `state()` may have changed. */
  onChange: () => void = () => {};
  readonly onError = showError;
  readonly parts: PlayerParts;
  private readonly mesh: ReelMesh;
  private readonly extras: FrameData;
  private loadingFrameData: Promise<void> | null = null;

  constructor(
    readonly element: ReelPlayerElement,
    private readonly reel: Reel,
    private readonly picture: Picture,
  ) {
    this.parts = partsOf(element);
    this.mesh = picture.mesh;
    this.extras = new FrameData(reel, picture, showError);
    this.parts.view.onDraw = () => picture.prepare();
    element.addEventListener("timeupdate", () => this.update());
    element.addEventListener("pause", () => this.redraw());
    for (const type of ["play", "waiting", "playing"]) {
      element.addEventListener(type, () => this.onChange());
    }
    new ResizeObserver(() => this.onChange()).observe(element);
  }

  get frame(): number {
    return this.mesh.frame;
  }

  get isPlaying(): boolean {
    return !this.element.paused;
  }

  state(): PlayerState {
    const { extras } = this;
    return {
      frame: this.frame,
      playing: this.isPlaying,
      heat: extras.heatKind,
      hottest: extras.heatMaximum,
      perFrameRange: extras.isPerFrameRange,
    };
  }

  toggle(): void {
    if (this.isPlaying) this.element.pause();
    else this.element.play().catch(() => {}); // the element displays what prevents it
  }

  /** Show a frame with its heat map and original; resolves once it is drawn. */
  async seek(frame: number): Promise<void> {
    const last = this.reel.segments.info.nFrames - 1;
    this.element.seek({ frame: Math.min(Math.max(0, Math.round(frame)), last) });
    await this.show();
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
      this.onChange();
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

  /** Hide the cells beyond a plane; null: none. */
  async cut(plane: CutPlane | null): Promise<void> {
    await this.picture.cut(plane);
    await this.show();
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

  /** Schedule a redraw with all data that the current look needs. */
  redraw(): void {
    this.parts.view.invalidate();
    if (!this.isPlaying) void this.loadFrameData().then(() => this.onChange(), showError);
    this.onChange();
  }

  /** Read the drawn positions (V, 3) back from the GPU, in model units. */
  positions(): Float32Array {
    const { center } = this.reel.file.info;
    return this.picture.positions().map((value, i) => value + center[i % 3]);
  }

  /** Measure the rate of redraws during playback, in frames per second. */
  async measureFps(seconds: number): Promise<number> {
    await this.show();
    void this.element.play();
    const started = performance.now();
    let nDrawn = 0;
    for (; performance.now() < started + 1000 * seconds; nDrawn++) {
      await new Promise(requestAnimationFrame);
      this.parts.view.drawNow();
    }
    this.picture.positions(); // waits for the GPU
    this.element.pause();
    return (1000 * nDrawn) / (performance.now() - started);
  }

  /** Called when another frame is shown. */
  private update(): void {
    if (!this.isPlaying) return this.redraw();
    this.extras.prefetch(this.frame, this.mesh.speed);
    this.extras.show(this.frame);
    this.onChange();
  }

  private async show(): Promise<void> {
    this.onChange();
    await this.waitUntilReady();
    await this.loadFrameData();
    this.parts.view.drawNow();
    this.onChange();
  }

  /** Wait until the current frame is available, or its block turns out to be damaged. */
  private async waitUntilReady(): Promise<void> {
    const { mesh } = this;
    while (mesh.isWaiting) {
      await new Promise<void>((resolve, reject) => {
        const end = (error?: Error) => {
          mesh.removeEventListener("frame", shown);
          mesh.removeEventListener("error", fail);
          if (error) reject(error);
          else resolve();
        };
        const shown = () => end();
        const fail = ({ error }: { error: Error }) => end(isDamageError(error) ? undefined : error);
        mesh.addEventListener("frame", shown);
        mesh.addEventListener("error", fail);
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
    this.parts.view.invalidate();
  }
}
