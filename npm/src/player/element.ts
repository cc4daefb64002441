// <reel-player>: a file that plays in a page.

import { InvalidInputError } from "../errors.js";
import { ReelMesh } from "../three/reel_mesh.js";
import type { OpenReel } from "../types.js";
import { PlayerAttributes } from "./attributes.js";
import { Bar, type BarState } from "./bar.js";
import { Legend } from "./legend.js";
import { Messages } from "./messages.js";
import { made, ShapeButton } from "./parts.js";
import { type Reach, reachOf } from "./reach.js";
import { ATTRIBUTES, type PlayerSettings, settingsOf } from "./settings.js";
import { openShared } from "./shared_reels.js";
import { playerSheet } from "./sheet.js";
import { View } from "./view.js";

/** Label of the picture where the page gives none. */
const NO_ALT = "Animated 3D model";

/** Settings of what is on the model: one that changes brings it anew. */
const OF_DRESS = [
  ...["texture", "kind", "offset", "frameNumber"],
  ...["track", "component", "range", "map"],
] as (keyof PlayerSettings)[];

/** What went wrong, and how it may end. */
interface Failure {
  readonly error: Error;
  /** Tries again; null where that cannot help. */
  readonly retry: (() => void) | null;
  /** It ends when a frame of this block is shown. */
  readonly block: number | null;
  /** It ends when the browser gives the graphics back. */
  readonly isOfGraphics: boolean;
}

/** All that is there while a player is in a page. */
interface Shown {
  readonly view: View;
  readonly bar: Bar;
  readonly messages: Messages;
  readonly legend: Legend;
  readonly start: ShapeButton;
  readonly poster: HTMLImageElement;
}

/**
 * The element `<reel-player>`: opens a `.reel` file and plays it.
 *
 * Attributes, all of which are properties too: `src`, `alt`, `autoplay`, `loop` (or
 * `loop="pingpong"`), `speed`, `start-time` or `start-frame`, `interpolate`, `camera-controls`,
 * `controls`, `up`, `background`, `poster`, `texture`, `texture-kind`, `texture-offset`,
 * `frame-number`, `muted`, `track`, `track-component`, `track-range` and `track-colormap`. Each may
 * change at any time.
 *
 * Events, which do not bubble: `load` (the file is open), `play`, `pause`, `timeupdate` (another
 * picture is shown), `waiting`, `playing`, `ended`, `warning` (a `CustomEvent` whose `detail` has
 * the `message`) and `error` (an `ErrorEvent`). Errors are shown in the element as well, until the
 * player works again. It requests what a server did not give again when the browser is back online;
 * a button does so too.
 *
 * Out of sight it stands still. Taken out of the page, it frees all that it holds.
 */
export class ReelPlayerElement extends PlayerAttributes {
  static readonly observedAttributes = ATTRIBUTES;
  readonly #stage = made("div", "stage");
  #shown: Shown | null = null;
  #settings: PlayerSettings | null = null;
  #loading: AbortController | null = null;
  #mesh: ReelMesh | null = null;
  /** Releases the file, which other players may show too. */
  #release: (() => void) | null = null;
  #reach: Reach = [1, 1, 1];
  #isRefreshing = false;
  #wasPlaying = false;
  /** Whether the attributes could not be understood. */
  #isRefused = false;
  /** Whether it plays on once it is seen again and the thumb of the timeline is released. */
  #isSuspended = false;
  /** Whether people hold the thumb of the timeline. */
  #isHeld = false;
  /** Whether it would play by itself, but was not allowed to. */
  #isHeldBack = false;
  #failure: Failure | null = null;
  #listening = new AbortController();

  constructor() {
    super();
    const root = this.attachShadow({ mode: "open" });
    root.adoptedStyleSheets = [playerSheet()];
    root.append(this.#stage);
    root.addEventListener("keydown", (event) => this.#press(event as KeyboardEvent));
  }

  /** The file; null before it is open. */
  get reel(): OpenReel | null {
    return this.#mesh?.reel ?? null;
  }

  /** What three.js draws; null before the file is open. Its classes are those of this script. */
  get mesh(): ReelMesh | null {
    return this.#mesh;
  }

  /** What went wrong last; null where nothing did, or it works again. */
  get error(): Error | null {
    return this.#failure?.error ?? null;
  }

  /** Seconds of the whole animation; NaN before the file is open. */
  get duration(): number {
    return this.#mesh?.duration ?? NaN;
  }

  /** Seconds since the first frame; 0 before the file is open. Setting it is `seek`. */
  get currentTime(): number {
    return this.#mesh?.time ?? 0;
  }

  set currentTime(seconds: number) {
    this.seek(seconds);
  }

  /** Whether it stands still. Out of sight, it is not paused: it goes on when it is seen again. */
  get paused(): boolean {
    return !this.#isPlaying;
  }

  /**
   * Plays on, or from the start if the end was reached.
   *
   * @throws InvalidInputError before the file is open: wait for the event `load`.
   */
  play(): void {
    const mesh = this.#required();
    if (this.#canMove) mesh.play();
    else this.#isSuspended = true;
    this.#changed();
  }

  /** Stands still. Before the file is open this does away with `autoplay`. */
  pause(): void {
    this.#isSuspended = false;
    if (this.#mesh) this.#mesh.pause();
    else this.autoplay = false;
    this.#changed();
  }

  /**
   * Goes to a time: seconds since the first frame, or a frame.
   *
   * @throws InvalidInputError before the file is open, or if it is not a finite number.
   */
  seek(to: number | { frame: number }): void {
    this.#required().seek(to);
    this.#changed();
  }

  /** Has the camera look from where it did at first. */
  resetCamera(): void {
    this.#shown?.view.camera.reset();
  }

  connectedCallback(): void {
    if (this.#shown) return; // moved within the page
    this.upgrade();
    this.#build();
    this.attributeChangedCallback();
  }

  disconnectedCallback(): void {
    queueMicrotask(() => {
      if (!this.isConnected) this.#free();
    });
  }

  /** Attributes are read together, once the script that changes them is done. */
  attributeChangedCallback(): void {
    if (!this.#shown || this.#isRefreshing) return;
    this.#isRefreshing = true;
    queueMicrotask(() => {
      this.#isRefreshing = false;
      if (this.#shown) this.#refresh();
    });
  }

  get #isPlaying(): boolean {
    return this.#isSuspended || (this.#mesh?.isPlaying ?? false);
  }

  /** Whether time may pass: not out of sight, nor while the thumb of the timeline is held. */
  get #canMove(): boolean {
    return !!this.#shown?.view.isSeen && !this.#isHeld;
  }

  #required(): ReelMesh {
    if (this.#mesh) return this.#mesh;
    throw new InvalidInputError('no file is open yet; wait for the event "load" of the player');
  }

  #build(): void {
    const view = new View(this.#stage, {
      hasPicture: () => !!this.#mesh && !this.#mesh.isWaiting,
      isMoving: () => !!this.#mesh && (this.#mesh.isPlaying || this.#mesh.isWaiting),
      pass: (seconds) => {
        this.#mesh?.update(seconds);
        this.#changed();
      },
      onSeen: () => this.#see(),
      onError: (error) => this.#fail(error),
      onLost: (error) => this.#fail(error, { isOfGraphics: true }),
      onRestored: () => {
        if (this.#failure?.isOfGraphics) this.#forgive();
      },
    });
    const bar = new Bar(this, {
      toggle: () => this.#toggle(),
      seek: (frame) => this.seek({ frame }),
      hold: (isHeld) => {
        if (isHeld === this.#isHeld) return;
        this.#isHeld = isHeld;
        this.#suspendOrGoOn();
      },
      mute: () => {
        const video = this.#mesh?.video;
        if (video) this.muted = !video.muted;
      },
    });
    const start = new ShapeButton("start", "play", "Play", () => this.#toggle());
    const poster = made("img", "poster");
    poster.alt = "";
    const messages = new Messages(() => this.#retry());
    const legend = new Legend();
    this.#stage.append(poster, legend.element, start.element);
    this.#stage.append(messages.waiting, bar.element, messages.alert);
    this.#shown = { view, bar, start, poster, messages, legend };
    this.#listening = new AbortController();
    const { signal } = this.#listening;
    window.addEventListener("online", () => this.#retry(), { signal });
  }

  #free(): void {
    if (!this.#shown) return;
    const { view, bar } = this.#shown;
    this.#listening.abort();
    this.#isHeld = false;
    this.#close();
    bar.dispose();
    view.dispose();
    this.#stage.replaceChildren();
    this.#shown = null;
    this.#settings = null;
  }

  /** Does what the attributes say, as far as it is new. */
  #refresh(): void {
    const { view, bar, poster } = this.#shown as Shown;
    view.canvas.setAttribute("aria-label", this.alt || NO_ALT);
    let next: PlayerSettings;
    try {
      next = settingsOf((name) => this.getAttribute(name));
      requireColor(next.background);
    } catch (error) {
      this.#isRefused = true;
      return this.#fail(error as Error);
    }
    if (this.#isRefused) this.#forgive();
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
      this.#forgive();
      void this.#open(next);
    } else if (this.#mesh) {
      this.#adapt(this.#mesh, next);
      if (last.up !== next.up) this.#aim(next);
      if (OF_DRESS.some((name) => !isSame(last[name], next[name]))) {
        void this.#dress(this.#mesh, next);
      }
    }
    this.#changed();
  }

  async #open(settings: PlayerSettings): Promise<void> {
    this.#close();
    if (settings.src === null) return;
    const { signal } = (this.#loading = new AbortController());
    this.#changed();
    let mesh: ReelMesh;
    try {
      const { reel, release } = await openShared(settings.src, signal);
      if (signal.aborted) return release();
      this.#release = release;
      // What is wrong with frames is told when they are shown.
      const reach = await reachOf(reel, settings.start, { signal }).catch(() => null);
      if (signal.aborted) return;
      const radius = reel.info.diagonal / 2;
      this.#reach = reach ?? [radius, radius, radius];
      mesh = new ReelMesh(reel, { origin: reel.info.center });
    } catch (error) {
      if (signal.aborted) return;
      this.#letGo();
      this.#loading = null;
      const retry = () => this.#settings && void this.#open(this.#settings);
      return this.#fail(error as Error, { retry });
    }
    this.#loading = null;
    this.#settings ??= settings;
    this.#begin(mesh, this.#settings);
    this.dispatchEvent(new Event("load"));
    await this.#dress(mesh, this.#settings);
    if (this.#mesh !== mesh || !this.#settings?.autoplay) return;
    this.#isHeldBack = matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (this.#isHeldBack) this.#changed();
    else this.play();
  }

  #begin(mesh: ReelMesh, settings: PlayerSettings): void {
    const { view } = this.#shown as Shown;
    this.#mesh = mesh;
    this.#listen(mesh);
    this.#adapt(mesh, settings);
    mesh.seek(settings.start);
    view.add(mesh);
    this.#aim(settings);
    if (view.renderer) mesh.setRenderer(view.renderer);
    this.#changed();
  }

  /** Has the camera look at all of the file. */
  #aim({ up }: PlayerSettings): void {
    const [x, y, z] = this.#reach;
    this.#shown?.view.camera.fit(up === "z" ? [x, z, y] : [x, y, z]);
  }

  /** Has a mesh play as the attributes say. */
  #adapt(mesh: ReelMesh, { loop, speed, interpolate, up, muted }: PlayerSettings): void {
    try {
      Object.assign(mesh, { loop, speed, interpolate });
    } catch (error) {
      this.#fail(error as Error);
    }
    mesh.rotation.x = up === "z" ? -Math.PI / 2 : 0;
    if (mesh.video) mesh.video.muted = muted;
    this.#shown?.view.invalidate();
  }

  async #dress(mesh: ReelMesh, settings: PlayerSettings): Promise<void> {
    const { texture, kind, offset, frameNumber, muted } = settings;
    const { track, component, range, map } = settings;
    this.#shown?.legend.show(null);
    try {
      if (track === null) await mesh.setTexture(texture, { kind, offset, frameNumber });
      else {
        const legend = await mesh.colorBy(track, { component, range, map });
        this.#shown?.legend.show(legend, mesh.reel.track(track).info.nColumns);
      }
      if (mesh.video) mesh.video.muted = muted;
      this.#shown?.view.invalidate();
    } catch (error) {
      if ((error as Error).name === "AbortError") return;
      this.#fail(error as Error, { retry: () => this.#dressAgain(mesh) });
    }
  }

  #dressAgain(mesh: ReelMesh): void {
    if (this.#settings && this.#mesh === mesh) void this.#dress(mesh, this.#settings);
  }

  #listen(mesh: ReelMesh): void {
    mesh.addEventListener("change", () => this.#shown?.view.invalidate());
    mesh.addEventListener("frame", ({ frame }) => {
      const { block = null } = this.#failure ?? {};
      if (block !== null && blockOf(mesh, frame) === block) this.#forgive();
      this.#shown?.view.invalidate();
      this.#changed();
      this.dispatchEvent(new Event("timeupdate"));
    });
    for (const type of ["waiting", "playing", "ended"] as const) {
      mesh.addEventListener(type, () => {
        this.#changed();
        this.dispatchEvent(new Event(type));
      });
    }
    mesh.addEventListener("warning", ({ message }) => {
      console.warn(`<reel-player>: ${message}`);
      this.#isHeldBack = !mesh.isPlaying;
      this.#changed();
      this.dispatchEvent(new CustomEvent("warning", { detail: { message } }));
    });
    mesh.addEventListener("error", ({ error, block, track }) => {
      if (block === null) return this.#fail(error);
      const retry = () => (track === undefined ? mesh.retry() : this.#dressAgain(mesh));
      const where = `${framesOf(mesh, block)} are missing: `;
      this.#fail(error, { where, retry, block: track === undefined ? block : null });
    });
  }

  /** Lets the file go, or what is under way. */
  #close(): void {
    this.#loading?.abort();
    this.#loading = null;
    this.#isSuspended = this.#isHeldBack = false;
    const mesh = this.#mesh;
    this.#mesh = null;
    if (mesh) {
      this.#shown?.legend.show(null);
      this.#shown?.view.remove(mesh);
      mesh.dispose();
    }
    this.#letGo();
  }

  #letGo(): void {
    this.#release?.();
    this.#release = null;
  }

  /**
   * Shows an error and dispatches it.
   *
   * @param how - `where`: what the message begins with; the rest as `Failure` has it. `retry` counts
   *   only where a server did not give what was asked for: other errors would be the same again.
   */
  #fail(error: Error, how: Partial<Failure & { where: string }> = {}): void {
    const { where = "", block = null, isOfGraphics = false } = how;
    const retry = (error.name === "SourceError" && how.retry) || null;
    this.#failure = { error, retry, block, isOfGraphics };
    this.#shown?.messages.say(`${where}${error.message}`, !this.#mesh, retry !== null);
    this.#changed();
    const { message } = error;
    this.dispatchEvent(new ErrorEvent("error", { error, message }));
  }

  /** Clears the error. */
  #forgive(): void {
    this.#isRefused = false;
    this.#failure = null;
    this.#shown?.messages.clear();
  }

  /** Asks again for what a server did not give. */
  #retry(): void {
    const retry = this.#failure?.retry;
    if (!retry) return;
    this.#forgive();
    retry();
    this.#changed();
  }

  #see(): void {
    const renderer = this.#shown?.view.renderer;
    if (renderer) this.#mesh?.setRenderer(renderer);
    this.#suspendOrGoOn();
  }

  /** Pauses while time may not pass, and then plays on. */
  #suspendOrGoOn(): void {
    const mesh = this.#mesh;
    if (!mesh) return;
    if (this.#canMove && this.#isSuspended) {
      this.#isSuspended = false;
      mesh.play();
    } else if (!this.#canMove && mesh.isPlaying) {
      this.#isSuspended = true;
      mesh.pause();
    }
    this.#changed();
  }

  #toggle(): void {
    if (!this.#mesh) return;
    if (this.#isPlaying) this.pause();
    else this.play();
  }

  /** Shows how things are, and tells of playing and pausing. */
  #changed(): void {
    if (!this.#shown) return;
    const { view, bar, start, messages, poster } = this.#shown;
    const mesh = this.#mesh;
    const isPlaying = this.#isPlaying;
    const hasPicture = !!mesh && mesh.geometry.drawRange.count > 0;
    poster.hidden = hasPicture || !poster.hasAttribute("src");
    const isWaiting = !!mesh && mesh.isWaiting && view.isSeen && !this.#failure?.retry;
    messages.wait(this.#loading !== null || isWaiting);
    if (isPlaying) this.#isHeldBack = false;
    start.element.hidden = !this.#isHeldBack || !!this.#settings?.controls;
    bar.show(mesh && stateOf(mesh, isPlaying));
    view.wake();
    if (isPlaying === this.#wasPlaying) return;
    this.#wasPlaying = isPlaying;
    this.dispatchEvent(new Event(isPlaying ? "play" : "pause"));
  }

  #press(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.#shown || !this.#mesh) return;
    const target = event.composedPath()[0];
    const { view } = this.#shown;
    const isHandled =
      event.key === " " && !(target instanceof HTMLButtonElement)
        ? this.#do(() => this.#toggle())
        : target === view.canvas && (view.camera.press(event.key) || this.#step(event.key));
    if (isHandled) event.preventDefault();
  }

  /** Goes to where a key says; false where it says nothing. */
  #step(key: string): boolean {
    const { frame, nFrames } = this.#required();
    const places: Record<string, number> = {
      Home: 0,
      End: nFrames - 1,
      ArrowLeft: frame - 1,
      ArrowRight: frame + 1,
      ",": frame - 1,
      ".": frame + 1,
    };
    return key in places && this.#do(() => this.seek({ frame: places[key] }));
  }

  #do(action: () => void): true {
    action();
    return true;
  }
}

function stateOf(mesh: ReelMesh, isPlaying: boolean): BarState {
  const { frame, nFrames, time, duration, video } = mesh;
  return { isPlaying, frame, nFrames, time, duration, isMuted: video?.muted ?? null };
}

function blockOf(mesh: ReelMesh, frame: number): number {
  return mesh.reel.info.blocks.findLastIndex(({ start }) => start <= frame);
}

function framesOf(mesh: ReelMesh, block: number): string {
  const { start, nFrames } = mesh.reel.info.blocks[block];
  return `Frames ${start} to ${start + nFrames - 1}`;
}

function isSame(one: unknown, other: unknown): boolean {
  return JSON.stringify(one) === JSON.stringify(other);
}

/** @throws InvalidInputError where CSS has no such colour. */
function requireColor(value: string | null): void {
  if (value === null || CSS.supports("color", value)) return;
  throw new InvalidInputError(`background is a color of CSS; got background="${value}"`);
}
