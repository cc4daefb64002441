// The control bar of a player: play, timeline, sound, full screen.

import { createElement, IconButton } from "./dom.js";

/** What the bar displays. */
export interface BarState {
  readonly isPlaying: boolean;
  readonly frame: number;
  readonly nFrames: number;
  /** In seconds. */
  readonly time: number;
  readonly duration: number;
  /** Null if there is no sound. */
  readonly isMuted: boolean | null;
}

/** Callbacks for input of the user. */
export interface BarActions {
  toggle(): void;
  seek(frame: number): void;
  /** Called when the user grabs or releases the thumb of the timeline. */
  scrub(isScrubbing: boolean): void;
  mute(): void;
}

/** The control bar of a player. */
export class Bar {
  readonly element: HTMLElement;
  readonly #play: IconButton;
  readonly #mute: IconButton;
  readonly #full: IconButton;
  readonly #range = createElement("input", "time");
  readonly #text = createElement("span", "text");
  readonly #host: HTMLElement;
  readonly #listeners = new AbortController();

  /** @param host - the element that becomes full screen */
  constructor(host: HTMLElement, actions: BarActions) {
    this.#host = host;
    this.#play = new IconButton("", "play", "Play", () => actions.toggle());
    this.#mute = new IconButton("", "loud", "Mute", () => actions.mute());
    this.#full = new IconButton("", "full", "Full screen", () => this.#toggleFull());
    this.#full.element.hidden = !document.fullscreenEnabled;
    const range = this.#range;
    Object.assign(range, { type: "range", min: "0", step: "1", value: "0" });
    range.setAttribute("aria-label", "Time");
    range.addEventListener("input", () => actions.seek(Number(range.value)));
    range.addEventListener("pointerdown", () => actions.scrub(true));
    this.#text.setAttribute("aria-hidden", "true"); // the range announces the time
    this.element = createElement(
      "div",
      "bar",
      this.#play.element,
      range,
      this.#text,
      this.#mute.element,
      this.#full.element,
    );
    const { signal } = this.#listeners;
    document.addEventListener("fullscreenchange", () => this.#showFull(), { signal });
    // The pointer is often outside of the range when it is released.
    for (const type of ["pointerup", "pointercancel"]) {
      window.addEventListener(type, () => actions.scrub(false), { signal, capture: true });
    }
  }

  /** Display a state; null: no file is open. */
  show(state: BarState | null): void {
    const range = this.#range;
    range.disabled = this.#play.element.disabled = state === null;
    this.#mute.element.hidden = state === null || state.isMuted === null;
    if (!state) {
      this.#text.textContent = "";
      return;
    }
    const { isPlaying, frame, nFrames, time, duration, isMuted } = state;
    this.#play.setAction(isPlaying ? "pause" : "play", isPlaying ? "Pause" : "Play");
    this.#mute.setAction(isMuted ? "muted" : "loud", isMuted ? "Unmute" : "Mute");
    range.max = String(nFrames - 1);
    range.value = String(frame);
    const words = `${time.toFixed(1)} of ${duration.toFixed(1)} seconds, frame ${frame}`;
    range.setAttribute("aria-valuetext", words);
    this.#text.textContent = `${formatTime(time)} / ${formatTime(duration)}`;
  }

  dispose(): void {
    this.#listeners.abort();
    this.element.remove();
  }

  #toggleFull(): void {
    // Ignore refusals: an iframe may lack the permission.
    if (this.#host.matches(":fullscreen")) void document.exitFullscreen().catch(() => {});
    else void this.#host.requestFullscreen().catch(() => {});
  }

  #showFull(): void {
    const isFull = this.#host.matches(":fullscreen");
    this.#full.setAction(isFull ? "small" : "full", isFull ? "Leave full screen" : "Full screen");
  }
}

/** Format a time as minutes, seconds and tenths. */
function formatTime(seconds: number): string {
  const tenths = Math.floor(10 * seconds + 1e-6);
  const minutes = Math.floor(tenths / 600);
  const rest = (tenths % 600) / 10;
  return `${minutes}:${rest < 10 ? "0" : ""}${rest.toFixed(1)}`;
}
