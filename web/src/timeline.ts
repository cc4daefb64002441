// The bar at the bottom: play, scrub, frame and time, speed, loop.

import { input, part } from "./page";
import type { Player } from "./player";
import { secondsOf, type Reel } from "./facts";

export class Timeline {
  private readonly scrub = input("scrub");
  private readonly play = part<HTMLButtonElement>("play");
  private readonly speed = part<HTMLSelectElement>("speed");
  private readonly loop = part<HTMLButtonElement>("loop");
  private shown = "";

  constructor(
    private readonly player: Player,
    private readonly reel: Reel,
  ) {
    this.scrub.max = String(reel.file.info.nFrames - 1);
    this.scrub.addEventListener("input", () => this.seek(Number(this.scrub.value)));
    this.play.addEventListener("click", () => this.toggle());
    part("previous").addEventListener("click", () => this.skip(-1));
    part("next").addEventListener("click", () => this.skip(1));
    this.loop.addEventListener("click", () => this.toggleLoop());
    this.speed.addEventListener("change", () => (player.speed = Number(this.speed.value)));
  }

  toggle(): void {
    if (this.player.isPlaying) this.player.pause();
    else this.player.play();
  }

  /** Pauses, so many frames from the one shown; at an end it starts at the other where it loops. */
  skip(count: number): void {
    this.player.pause();
    const n = this.reel.file.info.nFrames;
    const frame = this.player.frame + count;
    this.seek(this.player.isLooping && Math.abs(count) === 1 ? (frame + n) % n : frame);
  }

  seek(frame: number): void {
    void this.player.seek(frame).catch(this.player.failed);
  }

  toggleLoop(): void {
    this.player.isLooping = !this.player.isLooping;
    this.update();
  }

  /** The next speed of the list, up or down. */
  changeSpeed(by: 1 | -1): void {
    const at = this.speed.selectedIndex + by;
    this.speed.selectedIndex = Math.min(Math.max(0, at), this.speed.options.length - 1);
    this.player.speed = Number(this.speed.value);
  }

  update(): void {
    const { frame, playing, loop, buffering } = this.player.state();
    const key = `${frame} ${playing} ${loop} ${buffering}`;
    if (key === this.shown) return;
    this.shown = key;
    const last = this.reel.file.info.nFrames - 1;
    const [now, end] = [secondsOf(this.reel, frame), secondsOf(this.reel, last)];
    this.scrub.value = String(frame);
    this.scrub.setAttribute("aria-valuetext", `frame ${frame} of ${last}, ${now.toFixed(2)} s`);
    part("time").innerHTML =
      `<b>${frame}</b><small> / ${last}</small> &nbsp;${now.toFixed(2)}<small> / ${end.toFixed(2)} s</small>`;
    const name = playing ? "Pause" : "Play";
    this.play.classList.toggle("playing", playing);
    this.play.setAttribute("aria-label", name);
    this.play.title = `${name} (space)`;
    this.loop.setAttribute("aria-pressed", String(loop));
    part("buffering").hidden = !buffering;
  }
}
