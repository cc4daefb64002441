// Plays: knows which frame is due, has its data fetched, and draws when something has changed.

import { Cache } from "./cache";
import { Clock } from "./clock";
import { Extras } from "./extras";
import type { FrameErrors, HeatFields } from "./heat_fields";
import { ModeBlock } from "./gpu/mode_block";
import type { VertexGrid } from "./gpu/grid";
import type { Picture } from "./picture";
import { blockOf, mostModes, playingFps, type Reel } from "./reel";

const BLOCK_BYTES = 256e6;

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
  readonly clock: Clock;
  /** Called when anything in `state()` may have changed. */
  changed: () => void = () => {};
  failed: (error: unknown) => void = () => {};
  private nModes: number;
  private isSmoothPlay = false;
  private isBuffering = false;
  private isDirty = true;
  private isMeasuring = false;
  private nDrawn = 0;
  private drawMs = 0;
  private readonly blocks: Cache<ModeBlock>;
  private readonly extras: Extras;
  private settling: Promise<void> | null = null;

  constructor(
    private readonly reel: Reel,
    private readonly grid: VertexGrid,
    private readonly picture: Picture,
    fields: HeatFields,
  ) {
    this.clock = new Clock(reel.n_frames, playingFps(reel));
    this.nModes = mostModes(reel);
    const blockBytes = Math.max(1, 4 * grid.nVerts * this.nModes);
    this.blocks = new Cache(
      (number) => this.loadBlock(number),
      Math.max(3, Math.floor(BLOCK_BYTES / blockBytes)),
      (block) => block.dispose(),
    );
    this.extras = new Extras(reel, picture, fields, (frame) => this.decodedAt(frame));
    requestAnimationFrame((now) => this.tick(now));
  }

  get frame(): number {
    return Math.floor(this.clock.time);
  }

  state(): PlayerState {
    return {
      frame: this.frame,
      playing: this.clock.isPlaying,
      buffering: this.isBuffering,
      modes: this.nModes,
      isFew: this.extras.fewModes !== null,
      frameErrors: this.extras.frameErrors,
      heat: this.extras.heatKind,
      hottest: this.extras.hottest,
      speed: this.clock.speed,
      loop: this.clock.isLooping,
      smoothPlay: this.isSmoothPlay,
      perFrameRange: this.extras.isPerFrameRange,
      drawMs: this.drawMs,
    };
  }

  play(): void {
    this.clock.play();
    this.changed();
  }

  pause(): void {
    this.clock.pause();
    void this.show().catch(this.failed);
  }

  /** Shows a frame exactly, with its heat and original; resolves once it is drawn. */
  async seek(frame: number): Promise<void> {
    this.clock.time = Math.min(Math.max(0, Math.round(frame)), this.reel.n_frames - 1);
    await this.show();
  }

  setModes(nModes: number): void {
    const most = mostModes(this.reel);
    this.nModes = Math.min(Math.max(1, Math.round(nModes)), most);
    this.extras.fewModes = this.nModes < most ? this.nModes : null;
    this.redraw();
  }

  async setHeat(kind: string | null): Promise<void> {
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
    this.isSmoothPlay = isSmooth;
    this.redraw();
  }

  /** Draws again at the next occasion, with the data that the look needs now. */
  redraw(): void {
    this.isDirty = true;
    if (!this.clock.isPlaying) {
      void this.settle().then(() => this.changed(), this.failed);
    }
    this.changed();
  }

  /** Draws at once, for a picture that is read from the canvas in the same moment. */
  drawNow(): void {
    const block = this.blocks.peek(blockOf(this.reel, this.frame));
    if (block) this.draw(block);
  }

  /** Positions (V, 3) in model units as they are drawn, read back from the GPU. */
  positions(): Float32Array {
    const { origin } = this.reel;
    return this.picture.decoder.read().map((value, i) => value + origin[i % 3]);
  }

  /** Frames presented per second, as fast as the machine draws them while it plays. */
  async measureFps(seconds: number): Promise<number> {
    await this.show();
    this.isMeasuring = true;
    this.play();
    const started = performance.now();
    this.nDrawn = 0;
    await new Promise((resolve) => setTimeout(resolve, 1000 * seconds));
    this.picture.decoder.wait();
    const rate = (1000 * this.nDrawn) / (performance.now() - started);
    this.isMeasuring = false;
    this.pause();
    return rate;
  }

  private async show(): Promise<void> {
    this.changed();
    await this.blocks.load(blockOf(this.reel, this.frame));
    await this.settle();
    this.drawNow();
    this.changed();
  }

  // One at a time, and only for the frame that is wanted last: dragging does not flood the server.
  private async settle(): Promise<void> {
    this.settling ??= this.fetchShown().finally(() => (this.settling = null));
    await this.settling;
    if (!this.clock.isPlaying && !this.extras.areOf(this.frame)) await this.settle();
  }

  private async fetchShown(): Promise<void> {
    const { frame } = this;
    await Promise.all([this.blocks.load(blockOf(this.reel, frame)), this.extras.load(frame)]);
    this.extras.show(this.frame);
    this.isDirty = true;
  }

  private tick(nowMs: number): void {
    requestAnimationFrame((now) => this.tick(now));
    try {
      if (this.clock.isPlaying) this.playOn(nowMs);
      if (!this.isDirty && !this.isMeasuring) return;
      const block = this.blocks.peek(blockOf(this.reel, this.frame));
      if (block) this.draw(block);
    } catch (error) {
      this.fail(error);
    }
  }

  private readonly fail = (error: unknown) => {
    this.clock.isPlaying = false;
    this.isBuffering = false;
    this.failed(error);
    this.changed();
  };

  private playOn(nowMs: number): void {
    const number = blockOf(this.reel, this.frame);
    this.isBuffering = this.blocks.peek(number) === undefined;
    if (this.isBuffering) {
      this.clock.hold(nowMs);
      void this.blocks.load(number).catch(this.fail);
      this.changed();
      return;
    }
    const [before, time] = [this.frame, this.clock.time];
    this.clock.advance(nowMs);
    if (this.isSmoothPlay ? this.clock.time !== time : this.frame !== before) this.isDirty = true;
    this.prefetch(number);
    if (this.extras.show(this.frame)) this.isDirty = true;
    if (this.frame !== before) this.changed();
    if (!this.clock.isPlaying) this.pause();
  }

  private prefetch(block: number): void {
    const next = (block + 1) % this.reel.blocks.length;
    if (!this.blocks.isKnown(next)) void this.blocks.load(next).catch(this.fail);
    this.extras.prefetch(this.frame, this.clock.speed, this.fail);
  }

  private draw(block: ModeBlock): void {
    const started = performance.now();
    const t = this.frame - this.reel.blocks[blockOf(this.reel, this.frame)].start;
    const isBetween = this.isSmoothPlay && this.clock.isPlaying && t + 1 < block.nFrames;
    const fraction = isBetween ? this.clock.time - this.frame : 0;
    const nModes = Math.min(this.nModes, block.nModes);
    if (this.picture.decoder.decode(block, t, fraction, nModes)) this.picture.decodedMoved();
    this.picture.draw(block.centreAt(t, fraction, nModes));
    this.isDirty = false;
    this.nDrawn++;
    this.drawMs = performance.now() - started;
  }

  /** Positions (V, 3) of a frame relative to the origin, of the modes shown; null: not yet here. */
  private decodedAt(frame: number): Float32Array | null {
    const number = blockOf(this.reel, frame);
    const block = this.blocks.peek(number);
    if (!block) return null;
    const t = frame - this.reel.blocks[number].start;
    const { decoder } = this.picture;
    if (decoder.decode(block, t, 0, Math.min(this.nModes, block.nModes))) {
      this.picture.decodedMoved();
    }
    return decoder.read();
  }

  private async loadBlock(number: number): Promise<ModeBlock> {
    const block = await ModeBlock.load(number, this.grid);
    this.picture.decoder.prepare(block);
    return block;
  }
}
