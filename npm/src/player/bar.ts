// The control bar of a player: play, steps of a frame, timeline, speed, sound, full screen.

import { createElement, IconButton } from "./dom.js";

/** Speeds in the menu. */
const SPEEDS = [0.25, 0.5, 1, 2, 4];

/** What the bar displays. */
export interface BarState {
  readonly isPlaying: boolean;
  readonly frame: number;
  readonly nFrames: number;
  /** In seconds. */
  readonly time: number;
  readonly duration: number;
  readonly speed: number;
  /** Null if there is no sound. */
  readonly isMuted: boolean | null;
}

/** Callbacks for input of the user. */
export interface BarActions {
  toggle(): void;
  /** Pause, and move by a number of frames. */
  step(nFrames: number): void;
  setSpeed(speed: number): void;
  seek(frame: number): void;
  /** Called when the user grabs or releases the thumb of the timeline. */
  scrub(isScrubbing: boolean): void;
  mute(): void;
}

/** The control bar of a player. */
export class Bar {
  readonly element: HTMLElement;
  readonly timeline = createElement("input", "time");
  readonly #previous: IconButton;
  readonly #play: IconButton;
  readonly #next: IconButton;
  readonly #speed = createElement("select", "speed");
  readonly #mute: IconButton;
  readonly #full: IconButton;
  readonly #text = createElement("span", "text");
  readonly #host: HTMLElement;
  #isDetailed = false;
  readonly #listeners = new AbortController();

  /** @param host - the element that becomes full screen */
  constructor(host: HTMLElement, actions: BarActions) {
    this.#host = host;
    this.#previous = new IconButton("step", "previous", "Previous frame", () => actions.step(-1));
    this.#play = new IconButton("play", "play", "Play", () => actions.toggle());
    this.#next = new IconButton("step", "next", "Next frame", () => actions.step(1));
    this.#mute = new IconButton("", "loud", "Mute", () => actions.mute());
    this.#full = new IconButton("", "full", "Full screen", () => this.toggleFullScreen());
    this.#full.element.hidden = !document.fullscreenEnabled;
    const range = this.timeline;
    Object.assign(range, { type: "range", min: "0", step: "1", value: "0" });
    range.setAttribute("aria-label", "Time");
    range.addEventListener("input", () => actions.seek(Number(range.value)));
    range.addEventListener("pointerdown", () => actions.scrub(true));
    const speed = this.#speed;
    speed.title = "Speed";
    speed.setAttribute("aria-label", "Speed");
    speed.append(...SPEEDS.map(speedOption));
    speed.value = "1";
    speed.addEventListener("change", () => actions.setSpeed(Number(speed.value)));
    this.#text.setAttribute("aria-hidden", "true"); // the range announces the time
    const controls = createElement("slot", ""); // of the page
    controls.name = "controls";
    this.element = createElement(
      "div",
      "bar",
      this.#previous.element,
      this.#play.element,
      this.#next.element,
      range,
      this.#text,
      speed,
      this.#mute.element,
      controls,
      this.#full.element,
    );
    const { signal } = this.#listeners;
    document.addEventListener("fullscreenchange", () => this.#showFull(), { signal });
    // The pointer is often outside of the range when it is released.
    for (const type of ["pointerup", "pointercancel"]) {
      window.addEventListener(type, () => actions.scrub(false), { signal, capture: true });
    }
  }

  /**
   * Whether the bar also shows the number of the frame, and all controls on narrow screens, in a
   * second row.
   */
  set isDetailed(isOn: boolean) {
    this.#isDetailed = isOn;
    this.element.classList.toggle("detailed", isOn);
  }

  /** Select the next higher or lower speed of the menu. */
  changeSpeed(by: 1 | -1): void {
    const speed = this.#speed;
    const { length } = speed.options;
    speed.selectedIndex = Math.min(Math.max(0, speed.selectedIndex + by), length - 1);
    speed.dispatchEvent(new Event("change"));
  }

  /** Display a state; null: no file is open. */
  show(state: BarState | null): void {
    const range = this.timeline;
    for (const { element } of [this.#previous, this.#play, this.#next]) element.disabled = !state;
    range.disabled = state === null;
    this.#mute.element.hidden = state === null || state.isMuted === null;
    if (!state) {
      this.#text.textContent = "";
      return;
    }
    const { isPlaying, frame, nFrames, time, duration, speed, isMuted } = state;
    this.#play.setAction(isPlaying ? "pause" : "play", isPlaying ? "Pause" : "Play");
    this.#mute.setAction(isMuted ? "muted" : "loud", isMuted ? "Unmute" : "Mute");
    range.max = String(nFrames - 1);
    range.value = String(frame);
    const words = `${time.toFixed(1)} of ${duration.toFixed(1)} seconds, frame ${frame}`;
    range.setAttribute("aria-valuetext", words);
    const times = `${formatTime(time)} / ${formatTime(duration)}`;
    this.#text.textContent = this.#isDetailed ? `${frame} / ${nFrames - 1} · ${times}` : times;
    this.#showSpeed(speed);
  }

  dispose(): void {
    this.#listeners.abort();
    this.element.remove();
  }

  #showSpeed(speed: number): void {
    const select = this.#speed;
    const value = String(speed);
    if (select.value === value) return;
    const options = [...select.options];
    const isListed = options.some((option) => option.value === value);
    const faster = options.find((option) => Number(option.value) > speed) ?? null;
    if (!isListed) select.add(speedOption(speed), faster);
    select.value = value;
  }

  /** Enter or leave full screen. */
  toggleFullScreen(): void {
    // Ignore refusals: an iframe may lack the permission.
    if (this.#host.matches(":fullscreen")) void document.exitFullscreen().catch(() => {});
    else void this.#host.requestFullscreen().catch(() => {});
  }

  #showFull(): void {
    const isFull = this.#host.matches(":fullscreen");
    this.#full.setAction(isFull ? "small" : "full", isFull ? "Leave full screen" : "Full screen");
  }
}

function speedOption(speed: number): HTMLOptionElement {
  return new Option(`${speed}×`, String(speed));
}

/** Format a time as minutes, seconds and tenths. */
function formatTime(seconds: number): string {
  const tenths = Math.floor(10 * seconds + 1e-6);
  const minutes = Math.floor(tenths / 600);
  const rest = (tenths % 600) / 10;
  return `${minutes}:${rest < 10 ? "0" : ""}${rest.toFixed(1)}`;
}
