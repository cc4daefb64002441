// The bar of a player: play, time, sound, full screen.

import { made, ShapeButton } from "./parts.js";

/** What the bar shows. */
export interface BarState {
  readonly isPlaying: boolean;
  readonly frame: number;
  readonly nFrames: number;
  /** Seconds. */
  readonly time: number;
  readonly duration: number;
  /** Null: there is no sound to be muted. */
  readonly isMuted: boolean | null;
}

/** What people ask for by the bar. */
export interface BarActions {
  toggle(): void;
  seek(frame: number): void;
  /** The thumb of the timeline is held, or was released. */
  hold(isHeld: boolean): void;
  mute(): void;
}

/** The bar of a player. */
export class Bar {
  readonly element: HTMLElement;
  readonly #play: ShapeButton;
  readonly #mute: ShapeButton;
  readonly #full: ShapeButton;
  readonly #range = made("input", "time");
  readonly #text = made("span", "text");
  readonly #host: HTMLElement;
  readonly #listening = new AbortController();

  /** @param host - what fills the screen when that is asked for */
  constructor(host: HTMLElement, actions: BarActions) {
    this.#host = host;
    this.#play = new ShapeButton("", "play", "Play", () => actions.toggle());
    this.#mute = new ShapeButton("", "loud", "Mute", () => actions.mute());
    this.#full = new ShapeButton("", "full", "Full screen", () => this.#toggleFull());
    this.#full.element.hidden = !document.fullscreenEnabled;
    const range = this.#range;
    Object.assign(range, { type: "range", min: "0", step: "1", value: "0" });
    range.setAttribute("aria-label", "Time");
    range.addEventListener("input", () => actions.seek(Number(range.value)));
    range.addEventListener("pointerdown", () => actions.hold(true));
    this.#text.setAttribute("aria-hidden", "true"); // the range says it
    this.element = made(
      "div",
      "bar",
      this.#play.element,
      range,
      this.#text,
      this.#mute.element,
      this.#full.element,
    );
    const { signal } = this.#listening;
    document.addEventListener("fullscreenchange", () => this.#showFull(), { signal });
    // The thumb is often released beside the range.
    for (const type of ["pointerup", "pointercancel"]) {
      window.addEventListener(type, () => actions.hold(false), { signal, capture: true });
    }
  }

  /** Shows a state; null: nothing is there to be played. */
  show(state: BarState | null): void {
    const range = this.#range;
    range.disabled = this.#play.element.disabled = state === null;
    this.#mute.element.hidden = state === null || state.isMuted === null;
    if (!state) {
      this.#text.textContent = "";
      return;
    }
    const { isPlaying, frame, nFrames, time, duration, isMuted } = state;
    this.#play.say(isPlaying ? "pause" : "play", isPlaying ? "Pause" : "Play");
    this.#mute.say(isMuted ? "muted" : "loud", isMuted ? "Unmute" : "Mute");
    range.max = String(nFrames - 1);
    range.value = String(frame);
    const words = `${time.toFixed(1)} of ${duration.toFixed(1)} seconds, frame ${frame}`;
    range.setAttribute("aria-valuetext", words);
    this.#text.textContent = `${clock(time)} / ${clock(duration)}`;
  }

  dispose(): void {
    this.#listening.abort();
    this.element.remove();
  }

  #toggleFull(): void {
    // Refused, as a page in a frame may be, it stays as it is.
    if (this.#host.matches(":fullscreen")) void document.exitFullscreen().catch(() => {});
    else void this.#host.requestFullscreen().catch(() => {});
  }

  #showFull(): void {
    const isFull = this.#host.matches(":fullscreen");
    this.#full.say(isFull ? "small" : "full", isFull ? "Leave full screen" : "Full screen");
  }
}

/** Minutes, seconds and tenths. */
function clock(seconds: number): string {
  const tenths = Math.floor(10 * seconds + 1e-6);
  const minutes = Math.floor(tenths / 600);
  const rest = (tenths % 600) / 10;
  return `${minutes}:${rest < 10 ? "0" : ""}${rest.toFixed(1)}`;
}
