// The control bar at the bottom: play, timeline, frame and time, speed, loop.

import { inputById, byId } from "./page.js";
import type { Player } from "./player.js";
import { frameTime, type Reel } from "./facts.js";

export class Timeline {
  private readonly scrub = inputById("scrub");
  private readonly play = byId<HTMLButtonElement>("play");
  private readonly speed = byId<HTMLSelectElement>("speed");
  private readonly loop = byId<HTMLButtonElement>("loop");
  private shown = "";

  constructor(
    private readonly player: Player,
    private readonly reel: Reel,
  ) {
    this.scrub.max = String(reel.segments.info.nFrames - 1);
    this.scrub.addEventListener("input", () => this.seek(Number(this.scrub.value)));
    this.play.addEventListener("click", () => this.toggle());
    byId("previous").addEventListener("click", () => this.skip(-1));
    byId("next").addEventListener("click", () => this.skip(1));
    this.loop.addEventListener("click", () => this.toggleLoop());
    this.speed.addEventListener("change", () => (player.speed = Number(this.speed.value)));
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

  /** Select the next higher or lower speed. */
  changeSpeed(step: 1 | -1): void {
    const at = this.speed.selectedIndex + step;
    this.speed.selectedIndex = Math.min(Math.max(0, at), this.speed.options.length - 1);
    this.player.speed = Number(this.speed.value);
  }

  update(): void {
    const { frame, playing, loop, buffering } = this.player.state();
    const key = `${frame} ${playing} ${loop} ${buffering}`;
    if (key === this.shown) return;
    this.shown = key;
    const last = this.reel.segments.info.nFrames - 1;
    const [now, end] = [frameTime(this.reel, frame), frameTime(this.reel, last)];
    this.scrub.value = String(frame);
    this.scrub.setAttribute("aria-valuetext", `frame ${frame} of ${last}, ${now.toFixed(2)} s`);
    byId("time").innerHTML =
      `<b>${frame}</b><small> / ${last}</small> &nbsp;${now.toFixed(2)}<small> / ${end.toFixed(2)} s</small>`;
    const name = playing ? "Pause" : "Play";
    this.play.classList.toggle("playing", playing);
    this.play.setAttribute("aria-label", name);
    this.play.title = `${name} (space)`;
    this.loop.setAttribute("aria-pressed", String(loop));
    byId("buffering").hidden = !buffering;
  }
}
