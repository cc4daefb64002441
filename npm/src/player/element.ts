// The element <reel-player>.

import { InvalidInputError } from "../errors.js";
import { ReelMesh } from "../three/reel_mesh.js";
import type { FrameRange } from "../three/clock.js";
import type { OpenReel, OpenSegments } from "../types.js";
import { PlayerAttributes } from "./attributes.js";
import { Bar, type BarState } from "./bar.js";
import { Legend } from "./legend.js";
import { Messages } from "./messages.js";
import { createElement, IconButton } from "./dom.js";
import { type HalfExtents, estimateHalfExtents } from "./half_extents.js";
import { ATTRIBUTES, type PlayerSettings, parseSettings } from "./settings.js";
import { openShared } from "./shared_reels.js";
import { playerStyleSheet } from "./style_sheet.js";
import { View } from "./view.js";

/** Label of the canvas if the page sets no `alt`. */
const NO_ALT = "Animated 3D model";

/** Settings that determine the texture or the colors: a change applies them again. */
const APPEARANCE_KEYS = [
  ...["texture", "kind", "offset", "frameNumber"],
  ...["track", "component", "range", "map"],
] as (keyof PlayerSettings)[];

/** An error and the conditions that clear it. */
interface Failure {
  readonly error: Error;
  /** Retries; null if a retry cannot help. */
  readonly retry: (() => void) | null;
  /** Cleared when one of these frames is shown. */
  readonly frames: FrameRange | null;
  /** Cleared when the WebGL context is restored. */
  readonly isContextLoss: boolean;
}

/** The parts of a player that exist while it is connected to a document. */
interface Ui {
  readonly view: View;
  readonly bar: Bar;
  readonly messages: Messages;
  readonly legend: Legend;
  readonly start: IconButton;
  readonly poster: HTMLImageElement;
}

/**
 * The element `<reel-player>`: opens a `.reel` file and plays it.
 *
 * Attributes, which are also properties: `src`, `alt`, `autoplay`, `loop` (or
 * `loop="pingpong"`), `speed`, `start-time` or `start-frame`, `interpolate`, `camera-controls`,
 * `controls`, `up`, `background`, `poster`, `texture`, `texture-kind`, `texture-offset`,
 * `frame-number`, `muted`, `track`, `track-component`, `track-range` and `track-colormap`. All of
 * them may change at any time.
 *
 * Events, which do not bubble: `load` (the file is open), `play`, `pause`, `timeupdate` (another
 * frame is shown), `waiting`, `playing`, `ended`, `warning` (a `CustomEvent` whose `detail` has the
 * `message`) and `error` (an `ErrorEvent`). The element also displays errors until they are
 * resolved. Failed requests are retried when the browser is back online, or when the user presses
 * "Try again".
 *
 * The player pauses while it is off-screen. Removing it from the document frees its resources.
 */
export class ReelPlayerElement extends PlayerAttributes {
  static readonly observedAttributes = ATTRIBUTES;
  readonly #stage = createElement("div", "stage");
  #ui: Ui | null = null;
  #settings: PlayerSettings | null = null;
  #loading: AbortController | null = null;
  #mesh: ReelMesh | null = null;
  /** Releases the file, which other players may share. */
  #release: (() => void) | null = null;
  #extents: HalfExtents = [1, 1, 1];
  #isRefreshing = false;
  #wasPlaying = false;
  /** Whether the last attributes were invalid. */
  #hasInvalidAttributes = false;
  /** Whether to resume once the player is visible and the thumb of the timeline is released. */
  #isSuspended = false;
  /** Whether the user holds the thumb of the timeline. */
  #isScrubbing = false;
  /** Whether autoplay was prevented. */
  #isAutoplayBlocked = false;
  #failure: Failure | null = null;
  #listeners = new AbortController();

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    root.adoptedStyleSheets = [playerStyleSheet()];
    root.append(this.#stage);
    root.addEventListener("keydown", (event) => this.#handleKey(event as KeyboardEvent));
  }

  /** The open file, or its segment that is shown; null before the event `load`. */
  get reel(): OpenReel | null {
    return this.#mesh?.reel ?? null;
  }

  /** The open file with all its segments; null before the event `load`. */
  get file(): OpenSegments | null {
    return this.#mesh?.file ?? null;
  }

  /** The three.js mesh; null before the event `load`. It uses the three.js inside this script. */
  get mesh(): ReelMesh | null {
    return this.#mesh;
  }

  /** The last error; null if there was none or it is resolved. */
  get error(): Error | null {
    return this.#failure?.error ?? null;
  }

  /** Duration in seconds; NaN before the event `load`. */
  get duration(): number {
    return this.#mesh?.duration ?? NaN;
  }

  /** Time in seconds since the first frame; 0 before the event `load`. Setting it seeks. */
  get currentTime(): number {
    return this.#mesh?.time ?? 0;
  }

  set currentTime(seconds: number) {
    this.seek(seconds);
  }

  /** Whether playback is paused; false while it is only suspended because it is off-screen. */
  get paused(): boolean {
    return !this.#isPlaying;
  }

  /**
   * Play from the current time, or from the start if the end was reached.
   *
   * @throws InvalidInputError before the file is open: wait for the event `load`.
   */
  play(): void {
    const mesh = this.#requireMesh();
    if (this.#canPlay) mesh.play();
    else this.#isSuspended = true;
    this.#updateUi();
  }

  /** Pause. Before the file is open this removes `autoplay`. */
  pause(): void {
    this.#isSuspended = false;
    if (this.#mesh) this.#mesh.pause();
    else this.autoplay = false;
    this.#updateUi();
  }

  /**
   * Seek to a time in seconds since the first frame, or to a frame.
   *
   * @throws InvalidInputError before the file is open, or if it is not a finite number.
   */
  seek(to: number | { frame: number }): void {
    this.#requireMesh().seek(to);
    this.#updateUi();
  }

  /** Return the camera to its initial view. */
  resetCamera(): void {
    this.#ui?.view.camera.reset();
  }

  connectedCallback(): void {
    if (this.#ui) return; // moved within the document
    this.upgradeProperties();
    this.#build();
    this.attributeChangedCallback();
  }

  disconnectedCallback(): void {
    queueMicrotask(() => {
      if (!this.isConnected) this.#dispose();
    });
  }

  /** Changes of several attributes are applied together, in a microtask. */
  attributeChangedCallback(): void {
    if (!this.#ui || this.#isRefreshing) return;
    this.#isRefreshing = true;
    queueMicrotask(() => {
      this.#isRefreshing = false;
      if (this.#ui) this.#refresh();
    });
  }

  get #isPlaying(): boolean {
    return this.#isSuspended || (this.#mesh?.isPlaying ?? false);
  }

  /** Whether time may advance: the player is visible, and the user does not hold the thumb. */
  get #canPlay(): boolean {
    return !!this.#ui?.view.isVisible && !this.#isScrubbing;
  }

  #requireMesh(): ReelMesh {
    if (this.#mesh) return this.#mesh;
    throw new InvalidInputError('no file is open; wait for the event "load" of the player');
  }

  #build(): void {
    const view = new View(this.#stage, {
      hasPicture: () => !!this.#mesh && !this.#mesh.isWaiting,
      isAnimating: () => !!this.#mesh && (this.#mesh.isPlaying || this.#mesh.isWaiting),
      advance: (seconds) => {
        this.#mesh?.update(seconds);
        this.#updateUi();
      },
      onVisibilityChange: () => this.#onVisibilityChange(),
      onError: (error) => this.#reportError(error),
      onContextLost: (error) => this.#reportError(error, { isContextLoss: true }),
      onContextRestored: () => {
        if (this.#failure?.isContextLoss) this.#clearError();
      },
    });
    const bar = new Bar(this, {
      toggle: () => this.#toggle(),
      seek: (frame) => this.seek({ frame }),
      scrub: (isHeld) => {
        if (isHeld === this.#isScrubbing) return;
        this.#isScrubbing = isHeld;
        this.#suspendOrResume();
      },
      mute: () => {
        const video = this.#mesh?.video;
        if (video) this.muted = !video.muted;
      },
    });
    const start = new IconButton("start", "play", "Play", () => this.#toggle());
    const poster = createElement("img", "poster");
    poster.alt = "";
    const messages = new Messages(() => this.#retry());
    const legend = new Legend();
    this.#stage.append(poster, legend.element, start.element);
    this.#stage.append(messages.waiting, bar.element, messages.alert);
    this.#ui = { view, bar, start, poster, messages, legend };
    this.#listeners = new AbortController();
    const { signal } = this.#listeners;
    window.addEventListener("online", () => this.#retry(), { signal });
  }

  #dispose(): void {
    if (!this.#ui) return;
    const { view, bar } = this.#ui;
    this.#listeners.abort();
    this.#isScrubbing = false;
    this.#close();
    bar.dispose();
    view.dispose();
    this.#stage.replaceChildren();
    this.#ui = null;
    this.#settings = null;
  }

  /** Apply attributes that have changed. */
  #refresh(): void {
    const { view, bar, poster } = this.#ui as Ui;
    view.canvas.setAttribute("aria-label", this.alt || NO_ALT);
    let next: PlayerSettings;
    try {
      next = parseSettings((name) => this.getAttribute(name));
      requireColor(next.background);
    } catch (error) {
      this.#hasInvalidAttributes = true;
      return this.#reportError(error as Error);
    }
    if (this.#hasInvalidAttributes) this.#clearError();
    const last = this.#settings;
    this.#settings = next;
    view.camera.hasControls = next.cameraControls;
    this.#stage.style.backgroundColor = next.background ?? "";
    bar.element.hidden = !next.controls;
    if (poster.getAttribute("src") !== next.poster) {
      if (next.poster === null) poster.removeAttribute("src");
      else poster.src = next.poster;
    }
    if (!last || last.src !== next.src) {
      this.#clearError();
      void this.#open(next);
    } else if (this.#mesh) {
      this.#applySettings(this.#mesh, next);
      if (last.up !== next.up) this.#frameModel(next);
      if (APPEARANCE_KEYS.some((name) => !isEqual(last[name], next[name]))) {
        void this.#applyAppearance(this.#mesh, next);
      }
    }
    this.#updateUi();
  }

  async #open(settings: PlayerSettings): Promise<void> {
    this.#close();
    if (settings.src === null) return;
    const { signal } = (this.#loading = new AbortController());
    this.#updateUi();
    let mesh: ReelMesh;
    try {
      const { file, release } = await openShared(settings.src, signal);
      if (signal.aborted) return release();
      this.#release = release;
      // Errors of frames are reported when they are shown.
      const extents = await estimateHalfExtents(file, settings.start, { signal }).catch(() => null);
      if (signal.aborted) return;
      const { center, diagonal } = file.info;
      const radius = diagonal / 2;
      this.#extents = extents ?? [radius, radius, radius];
      mesh = new ReelMesh(file, { origin: center });
    } catch (error) {
      if (signal.aborted) return;
      this.#releaseReel();
      this.#loading = null;
      const retry = () => this.#settings && void this.#open(this.#settings);
      return this.#reportError(error as Error, { retry });
    }
    this.#loading = null;
    this.#settings ??= settings;
    this.#showMesh(mesh, this.#settings);
    this.dispatchEvent(new Event("load"));
    await this.#applyAppearance(mesh, this.#settings);
    if (this.#mesh !== mesh || !this.#settings?.autoplay) return;
    this.#isAutoplayBlocked = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (this.#isAutoplayBlocked) this.#updateUi();
    else this.play();
  }

  #showMesh(mesh: ReelMesh, settings: PlayerSettings): void {
    const { view } = this.#ui as Ui;
    this.#mesh = mesh;
    this.#listen(mesh);
    this.#applySettings(mesh, settings);
    mesh.seek(settings.start);
    view.add(mesh);
    this.#frameModel(settings);
    if (view.renderer) mesh.setRenderer(view.renderer);
    this.#updateUi();
  }

  /** Frame the model. */
  #frameModel({ up }: PlayerSettings): void {
    const [x, y, z] = this.#extents;
    this.#ui?.view.camera.fit(up === "z" ? [x, z, y] : [x, y, z]);
  }

  /** Apply the playback settings to a mesh. */
  #applySettings(mesh: ReelMesh, { loop, speed, interpolate, up, muted }: PlayerSettings): void {
    try {
      Object.assign(mesh, { loop, speed, interpolate });
    } catch (error) {
      this.#reportError(error as Error);
    }
    mesh.rotation.x = up === "z" ? -Math.PI / 2 : 0;
    if (mesh.video) mesh.video.muted = muted;
    this.#ui?.view.invalidate();
  }

  async #applyAppearance(mesh: ReelMesh, settings: PlayerSettings): Promise<void> {
    const { texture, kind, offset, frameNumber, muted } = settings;
    const { track, component, range, map } = settings;
    this.#ui?.legend.show(null);
    try {
      if (track === null) await mesh.setTexture(texture, { kind, offset, frameNumber });
      else {
        const legend = await mesh.colorBy(track, { component, range, map });
        this.#ui?.legend.show(legend, mesh.reel.track(track).info.nColumns);
      }
      if (mesh.video) mesh.video.muted = muted;
      this.#ui?.view.invalidate();
    } catch (error) {
      if ((error as Error).name === "AbortError") return;
      this.#reportError(error as Error, { retry: () => this.#retryAppearance(mesh) });
    }
  }

  #retryAppearance(mesh: ReelMesh): void {
    if (this.#settings && this.#mesh === mesh) void this.#applyAppearance(mesh, this.#settings);
  }

  #listen(mesh: ReelMesh): void {
    mesh.addEventListener("change", () => this.#ui?.view.invalidate());
    mesh.addEventListener("segment", () => this.#ui?.view.setLights(mesh));
    mesh.addEventListener("frame", ({ frame }) => {
      const { start, nFrames } = this.#failure?.frames ?? { start: 0, nFrames: 0 };
      if (frame >= start && frame < start + nFrames) this.#clearError();
      this.#ui?.view.invalidate();
      this.#updateUi();
      this.dispatchEvent(new Event("timeupdate"));
    });
    for (const type of ["waiting", "playing", "ended"] as const) {
      mesh.addEventListener(type, () => {
        this.#updateUi();
        this.dispatchEvent(new Event(type));
      });
    }
    mesh.addEventListener("warning", ({ message }) => {
      console.warn(`<reel-player>: ${message}`);
      this.#isAutoplayBlocked = !mesh.isPlaying;
      this.#updateUi();
      this.dispatchEvent(new CustomEvent("warning", { detail: { message } }));
    });
    mesh.addEventListener("error", ({ error, block, frames, track }) => {
      if (block === null) return this.#reportError(error);
      const { start, nFrames } = frames ?? mesh.reel.info.blocks[block];
      const retry = () => (track === undefined ? mesh.retry() : this.#retryAppearance(mesh));
      const prefix = `Frames ${start} to ${start + nFrames - 1} are missing: `;
      this.#reportError(error, { prefix, retry, frames });
    });
  }

  /** Close the file, or cancel opening it. */
  #close(): void {
    this.#loading?.abort();
    this.#loading = null;
    this.#isSuspended = this.#isAutoplayBlocked = false;
    const mesh = this.#mesh;
    this.#mesh = null;
    if (mesh) {
      this.#ui?.legend.show(null);
      this.#ui?.view.remove(mesh);
      mesh.dispose();
    }
    this.#releaseReel();
  }

  #releaseReel(): void {
    this.#release?.();
    this.#release = null;
  }

  /**
   * Display an error and dispatch it as an event.
   *
   * @param details - `prefix` precedes the message; for the rest see `Failure`. `retry` is used only
   *   for errors of the source: others would recur.
   */
  #reportError(error: Error, details: Partial<Failure & { prefix: string }> = {}): void {
    const { prefix = "", frames = null, isContextLoss = false } = details;
    const retry = (error.name === "SourceError" && details.retry) || null;
    this.#failure = { error, retry, frames, isContextLoss };
    this.#ui?.messages.showError(`${prefix}${error.message}`, !this.#mesh, retry !== null);
    this.#updateUi();
    const { message } = error;
    this.dispatchEvent(new ErrorEvent("error", { error, message }));
  }

  /** Clear the error. */
  #clearError(): void {
    this.#hasInvalidAttributes = false;
    this.#failure = null;
    this.#ui?.messages.clearError();
  }

  /** Retry after an error of the source. */
  #retry(): void {
    const retry = this.#failure?.retry;
    if (!retry) return;
    this.#clearError();
    retry();
    this.#updateUi();
  }

  #onVisibilityChange(): void {
    const renderer = this.#ui?.view.renderer;
    if (renderer) this.#mesh?.setRenderer(renderer);
    this.#suspendOrResume();
  }

  /** Pause playback while time must not advance, and resume it afterwards. */
  #suspendOrResume(): void {
    const mesh = this.#mesh;
    if (!mesh) return;
    if (this.#canPlay && this.#isSuspended) {
      this.#isSuspended = false;
      mesh.play();
    } else if (!this.#canPlay && mesh.isPlaying) {
      this.#isSuspended = true;
      mesh.pause();
    }
    this.#updateUi();
  }

  #toggle(): void {
    if (!this.#mesh) return;
    if (this.#isPlaying) this.pause();
    else this.play();
  }

  /** Update the user interface; dispatch `play` or `pause` if that has changed. */
  #updateUi(): void {
    if (!this.#ui) return;
    const { view, bar, start, messages, poster } = this.#ui;
    const mesh = this.#mesh;
    const isPlaying = this.#isPlaying;
    const hasPicture = !!mesh && mesh.geometry.drawRange.count > 0;
    poster.hidden = hasPicture || !poster.hasAttribute("src");
    const isWaiting = !!mesh && mesh.isWaiting && view.isVisible && !this.#failure?.retry;
    messages.showLoading(this.#loading !== null || isWaiting);
    if (isPlaying) this.#isAutoplayBlocked = false;
    start.element.hidden = !this.#isAutoplayBlocked || !!this.#settings?.controls;
    bar.show(mesh && barState(mesh, isPlaying));
    view.scheduleFrame();
    if (isPlaying === this.#wasPlaying) return;
    this.#wasPlaying = isPlaying;
    this.dispatchEvent(new Event(isPlaying ? "play" : "pause"));
  }

  #handleKey(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.#ui || !this.#mesh) return;
    const target = event.composedPath()[0];
    const { view } = this.#ui;
    const isHandled =
      event.key === " " && !(target instanceof HTMLButtonElement)
        ? this.#run(() => this.#toggle())
        : target === view.canvas && (view.camera.handleKey(event.key) || this.#seekByKey(event.key));
    if (isHandled) event.preventDefault();
  }

  /** Seek by a key press; returns false for other keys. */
  #seekByKey(key: string): boolean {
    const { frame, nFrames } = this.#requireMesh();
    const frames: Record<string, number> = {
      Home: 0,
      End: nFrames - 1,
      ArrowLeft: frame - 1,
      ArrowRight: frame + 1,
      ",": frame - 1,
      ".": frame + 1,
    };
    return key in frames && this.#run(() => this.seek({ frame: frames[key] }));
  }

  #run(action: () => void): true {
    action();
    return true;
  }
}

function barState(mesh: ReelMesh, isPlaying: boolean): BarState {
  const { frame, nFrames, time, duration, video } = mesh;
  return { isPlaying, frame, nFrames, time, duration, isMuted: video?.muted ?? null };
}

function isEqual(one: unknown, other: unknown): boolean {
  return JSON.stringify(one) === JSON.stringify(other);
}

/** @throws InvalidInputError if a value is not a CSS color. */
function requireColor(value: string | null): void {
  if (value === null || CSS.supports("color", value)) return;
  throw new InvalidInputError(`background must be a CSS color; got background="${value}"`);
}
