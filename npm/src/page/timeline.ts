// The control bar at the bottom: that of <reel-player>, with a button to loop.

import { Bar } from "../player/bar.js";
import { BAR_CSS, LEGEND_CSS } from "../player/style_sheet.js";
import { byId } from "./page.js";
import type { Player } from "./player.js";
import { frameTime, type Reel } from "./facts.js";

export class Timeline {
  readonly bar: Bar;
  private readonly loop = byId<HTMLButtonElement>("loop");
  private shown = "";
  /** Whether to play again when the thumb is released. */
  private isInterrupted = false;

  constructor(
    private readonly player: Player,
    private readonly reel: Reel,
  ) {
    this.bar = new Bar(document.documentElement, {
      toggle: () => this.toggle(),
      seek: (frame) => this.seek(frame),
      step: (count) => this.skip(count),
      setSpeed: (speed) => (player.speed = speed),
      scrub: (isHeld) => this.interrupt(isHeld),
      mute: () => {}, // hidden: the page has no sound
    });
    this.bar.showsFrames = true;
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(BAR_CSS + LEGEND_CSS);
    document.adoptedStyleSheets.push(sheet);
    for (const id of ["loop", "help-button", "panel-button"]) this.bar.add(byId(id));
    byId("timeline").append(this.bar.element);
    this.loop.addEventListener("click", () => this.toggleLoop());
  }

  toggle(): void {
    if (this.player.isPlaying) this.player.pause();
    else this.player.play();
  }

  /** Pause, and move by a number of frames; single steps wrap around if looping is on. */
  skip(count: number): void {
    this.player.pause();
    const n = this.reel.segments.info.nFrames;
    const frame = this.player.frame + count;
    this.seek(this.player.isLooping && Math.abs(count) === 1 ? (frame + n) % n : frame);
  }

  seek(frame: number): void {
    void this.player.seek(frame).catch(this.player.onError);
  }

  toggleLoop(): void {
    this.player.isLooping = !this.player.isLooping;
    this.update();
  }

  update(): void {
    const { frame, playing, loop, buffering, speed } = this.player.state();
    const key = `${frame} ${playing} ${loop} ${buffering} ${speed}`;
    if (key === this.shown) return;
    this.shown = key;
    const { nFrames } = this.reel.segments.info;
    this.bar.show({
      ...{ isPlaying: playing || this.isInterrupted, frame, nFrames, speed, isMuted: null },
      time: frameTime(this.reel, frame),
      duration: frameTime(this.reel, nFrames),
    });
    this.loop.setAttribute("aria-pressed", String(loop));
    byId("buffering").hidden = !buffering;
  }

  /** Stop time while the user holds the thumb. */
  private interrupt(isHeld: boolean): void {
    if (isHeld && this.player.isPlaying) {
      this.isInterrupted = true;
      this.player.pause();
    } else if (!isHeld && this.isInterrupted) {
      this.isInterrupted = false;
      this.player.play();
    }
  }
}
