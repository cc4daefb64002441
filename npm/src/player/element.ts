// The element <reel-player>.

import { InvalidInputError } from "../errors.js";
import { SegmentedReelFile } from "../index.js";
import { ReelMesh } from "../three/reel_mesh.js";
import type { TextureOptions } from "../three/texture/mesh_texture.js";
import type { FrameRange } from "../three/clock.js";
import { openShared } from "../source/shared.js";
import type { SourceInput } from "../source/transport.js";
import type { OpenReel, OpenSegments } from "../types.js";
import { Vector3 } from "../webgl/index.js";
import { PlayerAttributes } from "./attributes.js";
import { Bar, type BarState } from "./bar.js";
import { Legend, trackTitle } from "./legend.js";
import { Messages } from "./messages.js";
import type { CameraOrbit } from "./orbit_controls.js";
import { createElement, IconButton } from "./dom.js";
import { type Framing, estimateFraming, turned, unknownFraming } from "./framing.js";
import { ATTRIBUTE_NAMES, type PlayerSettings, parseSettings } from "./settings.js";
import { playerStyleSheet } from "./style_sheet.js";
import { View } from "./view.js";

/** Label of the canvas if the page sets no `alt`. */
const NO_ALT = "Animated 3D model";

/** Settings that determine the texture or the colors: a change applies them again. */
const APPEARANCE_KEYS = [
  ...["texture", "kind", "offset"],
  ...["track", "component", "range", "map"],
] as (keyof PlayerSettings)[];

/** Settings of the view: a change frames the model again. */
const VIEW_KEYS = ["up", "camera", "autoRotate"] as const;

/** The camera follows a model that moves if that brings it closer by this factor. */
const FOLLOW_RATIO = 1.1;

/** Distance to the viewport at which a player with `loading="lazy"` opens its file. */
const LAZY_MARGIN = "400px";

/** A pending promise of `play`. */
interface PlayRequest {
  resolve(): void;
  reject(error: Error): void;
}

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

/** The mesh of a player: the part of a `ReelMesh` that does not depend on three.js. */
export type PlayerMesh = Pick<
  ReelMesh,
  | ("file" | "reel" | "segment" | "isOnGpu" | "positionsAt" | "addEventListener" | "removeEventListener")
  | ("play" | "pause" | "retry" | "seek" | "isPlaying" | "isWaiting" | "isLoading" | "buffered")
  | ("time" | "duration" | "frame" | "nFrames" | "loop" | "speed" | "interpolate")
  | ("colorBy" | "video")
> & {
  setTexture(
    source: string | HTMLVideoElement | HTMLImageElement | ImageBitmap | null,
    options?: TextureOptions,
  ): Promise<void>;
};

/** The parts of a player that exist while it is connected to a document. */
export interface PlayerParts {
  mesh(): ReelMesh | null;
  readonly view: View;
  readonly bar: Bar;
  readonly messages: Messages;
  readonly legend: Legend;
  readonly start: IconButton;
  readonly poster: HTMLImageElement;
  /**
   * Frame the model in the initial view; returns whether the camera follows it.
   *
   * @param isFollowed - whether it shall, also in later calls; null: if the model moves far
   */
  frame(isFollowed: boolean | null): boolean;
  /** Pause, and move by a number of frames; while looping, past the end to the start. */
  step(nFrames: number): void;
  /** Colors by the track again after an error, if the page has set it by `mesh.colorBy`. */
  retryTrack: (() => void) | null;
}

/** Return the parts of a connected player, for the inspector. */
export let partsOf: (player: ReelPlayerElement) => PlayerParts;

/**
 * The element `<reel-player>`: opens a `.reel` file and plays it.
 *
 * Its attributes, which are also properties, are those of `ATTRIBUTES`. All of them may change at any
 * time.
 *
 * Properties and methods have the names of `<video>` and `<model-viewer>` where these have them.
 *
 * Events, which do not bubble: `load` (the file is open), `progress` (frames were loaded), `play`,
 * `pause`, `timeupdate` (another frame is shown), `waiting`, `playing`, `seeking`, `seeked`,
 * `ratechange`, `ended`, `camera-change`, `warning` (a `CustomEvent` whose `detail` has the
 * `message`) and `error` (an `ErrorEvent`). The element also displays errors until they are
 * resolved. Failed requests are retried when the browser is back online, or when the user presses
 * "Try again".
 *
 * The player pauses while it is off-screen. Removing it from the document frees its resources.
 */
export class ReelPlayerElement extends PlayerAttributes {
  static readonly observedAttributes = ATTRIBUTE_NAMES;
  static {
    partsOf = (player) => player.#ui as PlayerParts;
  }
  readonly #stage = createElement("div", "stage");
  #ui: PlayerParts | null = null;
  #settings: PlayerSettings | null = null;
  #loading: AbortController | null = null;
  #mesh: ReelMesh | null = null;
  #framing: Framing = unknownFraming(1);
  /** Whether the camera follows the model; null: if that moves far. */
  #isFollowed: boolean | null = null;
  #srcObject: Exclude<SourceInput, string | URL> | null = null;
  /** Address of the video in an open MP4 file, or null. */
  #video: string | null = null;
  /** What is open or opening: an address or an object. */
  #openedSource: SourceInput | null = null;
  /** Waits until the player is near the viewport; null unless a lazy file is to be opened. */
  #lazyObserver: IntersectionObserver | null = null;
  /** Whether `play` was called before the file is open. */
  #isPlayPending = false;
  #playRequests: PlayRequest[] = [];
  #isSeeking = false;
  #hasEnded = false;
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

  /** The mesh; null before the event `load`. It is no object of three.js. */
  get mesh(): PlayerMesh | null {
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
    return !this.#isPlaying && !this.#isPlayPending;
  }

  /** Whether playback has reached the end and has not been continued. */
  get ended(): boolean {
    return this.#hasEnded;
  }

  /** Whether the picture of a seek is still being loaded. */
  get seeking(): boolean {
    return this.#isSeeking;
  }

  /** Playback rate; negative values play backwards. The attribute `speed` reflects it. */
  get playbackRate(): number {
    return this.speed ?? 1;
  }

  set playbackRate(rate: number) {
    if (!Number.isFinite(rate)) {
      throw new InvalidInputError(`playbackRate must be a finite number; got ${rate}`);
    }
    this.speed = rate;
  }

  /** A blob or bytes to play in place of `src`; null: none. */
  get srcObject(): Exclude<SourceInput, string | URL> | null {
    return this.#srcObject;
  }

  set srcObject(source: Exclude<SourceInput, string | URL> | null) {
    this.#srcObject = source;
    this.attributeChangedCallback();
  }

  /**
   * Play from the current time, or from the start if the end was reached; before the file is open,
   * as soon as it is.
   *
   * @returns Resolves when playback has started. Rejected with the error of the file, with an
   *   `AbortError` by `pause` and by a change of `src`, and with a `NotAllowedError` if the browser
   *   blocks the sound of a video.
   */
  play(): Promise<void> {
    if (this.#isRefreshing && this.#ui) this.#refresh(); // `src` may have just been set
    return new Promise((resolve, reject) => {
      this.#playRequests.push({ resolve, reject });
      this.#hasEnded = false;
      if (!this.#mesh) {
        this.#isPlayPending = true;
        const isFailed = this.#failure && !this.#loading;
        if (isFailed) this.#rejectPlay((this.#failure as Failure).error);
      } else if (this.#canPlay) this.#mesh.play();
      else this.#isSuspended = true;
      this.#updateUi();
    });
  }

  /** Pause. Before the file is open this removes `autoplay`. */
  pause(): void {
    this.#isSuspended = false;
    if (this.#mesh) this.#mesh.pause();
    else this.autoplay = false;
    this.#rejectPlay(new DOMException("playback was paused", "AbortError"));
    this.#updateUi();
  }

  /**
   * Seek to a time in seconds since the first frame, or to a frame.
   *
   * @throws InvalidInputError before the file is open, or if it is not a finite number.
   */
  seek(to: number | { frame: number }): void {
    this.#requireMesh().seek(to);
    this.#hasEnded = false;
    this.#isSeeking = true;
    this.#dispatchLater("seeking");
    this.#updateUi();
  }

  /** Return the camera to its initial view. */
  resetCamera(): void {
    this.#ui?.view.camera.reset();
  }

  /** Return where the camera is relative to its target: angles in radians, distance in model units. */
  getCameraOrbit(): CameraOrbit {
    return this.#ui?.view.camera.orbit ?? { theta: 0, phi: 0, radius: 0 };
  }

  /** Return the point that the camera looks at, in coordinates of the file. */
  getCameraTarget(): { x: number; y: number; z: number } {
    const { view } = this.#ui ?? {};
    if (!view || !this.#mesh) return { x: 0, y: 0, z: 0 };
    const [x, y, z] = this.#mesh.file.info.center;
    const point = view.model.worldToLocal(view.camera.target.clone());
    return { x: point.x + x, y: point.y + y, z: point.z + z };
  }

  /** Return the vertical field of view in degrees. */
  getFieldOfView(): number {
    return this.#ui?.view.camera.camera.fov ?? NaN;
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
    const overlay = createElement("slot", "");
    overlay.name = "overlay"; // of the page
    const picture = createElement("div", "picture", overlay);
    const view = new View(picture, {
      hasPicture: () => !!this.#mesh && !this.#mesh.isWaiting,
      isAnimating: () => {
        const mesh = this.#mesh;
        return !!mesh && (mesh.isPlaying || mesh.isWaiting || this.#isAutoRotating);
      },
      advance: (seconds) => {
        if (this.#isAutoRotating) view.camera.autoRotate(seconds);
        this.#mesh?.update(seconds);
        this.#updateUi();
      },
      onVisibilityChange: () => this.#onVisibilityChange(),
      onCameraChange: (isByUser) => {
        const detail = { source: isByUser ? "user-interaction" : "none" };
        this.dispatchEvent(new CustomEvent("camera-change", { detail }));
      },
      onError: (error) => this.#reportError(error),
      onContextLost: (error) => this.#reportError(error, { isContextLoss: true }),
      onContextRestored: () => {
        if (this.#failure?.isContextLoss) this.#clearError();
      },
    });
    const bar = new Bar(this, {
      toggle: () => this.#toggle(),
      seek: (frame) => this.seek({ frame }),
      step: (nFrames) => this.#step(nFrames),
      setSpeed: (speed) => {
        this.playbackRate = speed;
      },
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
    // A click leaves the keys to the canvas; Tab leaves them to the button.
    bar.element.addEventListener("click", ({ detail, target }) => {
      if (detail && target instanceof Element && target.closest("button")) {
        view.canvas.focus({ preventScroll: true });
      }
    });
    const start = new IconButton("start", "play", "Play", () => this.#toggle());
    const poster = createElement("img", "poster");
    poster.alt = "";
    const messages = new Messages(() => this.#retry());
    const legend = new Legend();
    overlay.before(poster, start.element);
    overlay.after(messages.waiting, messages.alert);
    this.#stage.append(picture, legend.element, bar.element);
    const frame = (isFollowed: boolean | null): boolean => {
      this.#isFollowed = isFollowed;
      return !!this.#mesh && !!this.#settings && this.#frameModel(this.#settings);
    };
    const step = (nFrames: number) => this.#step(nFrames);
    const mesh = () => this.#mesh;
    this.#ui = { mesh, view, bar, start, poster, messages, legend, frame, step, retryTrack: null };
    this.#listeners = new AbortController();
    const { signal } = this.#listeners;
    window.addEventListener("online", () => this.#retry(), { signal });
  }

  #dispose(): void {
    if (!this.#ui) return;
    const { view, bar } = this.#ui;
    this.#listeners.abort();
    this.#lazyObserver?.disconnect();
    this.#lazyObserver = null;
    this.#isScrubbing = false;
    this.#close();
    this.#openedSource = null;
    bar.dispose();
    view.dispose();
    this.#stage.replaceChildren();
    this.#ui = null;
    this.#settings = null;
  }

  /** Apply attributes that have changed. */
  #refresh(): void {
    const { view, bar, poster } = this.#ui as PlayerParts;
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
    const source = this.#srcObject ?? next.src;
    if (!last || source !== this.#openedSource) {
      this.#clearError();
      this.#openedSource = source;
      if (next.loading === "lazy" && source !== null) this.#openWhenNear();
      else void this.#open(next);
    } else if (next.loading === "eager" && this.#lazyObserver) void this.#open(next);
    else if (this.#mesh) {
      this.#applySettings(this.#mesh, next);
      if (VIEW_KEYS.some((name) => !isEqual(last[name], next[name]))) this.#frameModel(next);
      if (APPEARANCE_KEYS.some((name) => !isEqual(last[name], next[name]))) {
        void this.#applyAppearance(this.#mesh, next);
      }
    }
    if (last && last.speed !== next.speed) this.dispatchEvent(new Event("ratechange"));
    this.#updateUi();
  }

  /** Open the file when the player is near the viewport. */
  #openWhenNear(): void {
    this.#close();
    const open = ([...entries]: IntersectionObserverEntry[]): void => {
      if (entries.some((entry) => entry.isIntersecting) && this.#settings) void this.#open(this.#settings);
    };
    this.#lazyObserver = new IntersectionObserver(open, { rootMargin: LAZY_MARGIN });
    this.#lazyObserver.observe(this);
  }

  async #open(settings: PlayerSettings): Promise<void> {
    this.#close();
    const source = this.#openedSource;
    if (source === null) return;
    const { signal } = (this.#loading = new AbortController());
    this.#updateUi();
    let file: SegmentedReelFile | null = null;
    let mesh: ReelMesh;
    try {
      const from = typeof source === "string" ? new URL(source, document.baseURI) : source;
      file = await SegmentedReelFile.open(from instanceof URL ? openShared(from.href, signal) : from, { signal });
      // Errors of frames are reported when they are shown.
      const framing = await estimateFraming(file, settings.start, { signal }).catch(() => null);
      signal.throwIfAborted();
      this.#video = file.isInMp4 ? addressOf(from) : null;
      const { center, diagonal } = file.info;
      this.#framing = framing ?? unknownFraming(diagonal / 2);
      mesh = new ReelMesh(file, { origin: center, ownsReel: true });
    } catch (error) {
      file?.close();
      if (signal.aborted) return;
      this.#loading = null;
      const retry = () => this.#settings && void this.#open(this.#settings);
      this.#rejectPlay(error as Error);
      return this.#reportError(error as Error, { retry });
    }
    this.#loading = null;
    this.#settings ??= settings;
    this.#showMesh(mesh, this.#settings);
    this.dispatchEvent(new Event("load"));
    await this.#applyAppearance(mesh, this.#settings);
    if (this.#mesh !== mesh || this.#isPlaying || !this.#settings?.autoplay) return;
    this.#isAutoplayBlocked = prefersReducedMotion();
    if (this.#isAutoplayBlocked) this.#updateUi();
    else this.#start();
  }

  #showMesh(mesh: ReelMesh, settings: PlayerSettings): void {
    const { view } = this.#ui as PlayerParts;
    this.#mesh = mesh;
    this.#listen(mesh);
    this.#applySettings(mesh, settings);
    mesh.seek(settings.start);
    view.add(mesh);
    this.#frameModel(settings);
    if (view.renderer) mesh.setRenderer(view.renderer);
    if (this.#isPlayPending) {
      this.#isPlayPending = false;
      if (this.#canPlay) mesh.play();
      else this.#isSuspended = true;
    }
    this.#updateUi();
  }

  /** Frame the model in the initial view; returns whether the camera follows it. */
  #frameModel({ up, camera, autoRotate }: PlayerSettings): boolean {
    const { view } = this.#ui as PlayerParts;
    const { swept, figure } = this.#framing;
    view.world.setRotationX(up === "z" ? -Math.PI / 2 : 0);
    view.world.updateMatrixWorld();
    view.follow(null);
    view.radius = Math.max(...swept.map((point) => point.length()));
    const framed = (points: readonly Vector3[]): Vector3[] => {
      const placed = points.map((point) => point.clone().applyMatrix4(view.world.matrixWorld));
      return autoRotate ? turned(placed) : placed;
    };
    const points = framed(swept);
    const target = this.#worldTarget(camera.target);
    view.frame(points, points, { ...camera, target });
    if (!figure || target || camera.distance !== null) return false;
    const pose = framed(figure);
    // Meshes of other segments may have centroids elsewhere.
    const movesFar =
      this.#mesh?.file.segments.length === 1 &&
      view.sizeOf(pose) >= FOLLOW_RATIO * view.sizeOf(points);
    if (!(this.#isFollowed ?? movesFar)) return false;
    view.follow(this.#mesh);
    view.frame(pose, points, { ...camera, target });
    return true;
  }

  /** Convert `camera-target` to the coordinates of the view; null if it is the center of the model. */
  #worldTarget(target: readonly (number | null)[]): Vector3 | null {
    const { center } = (this.#mesh as ReelMesh).file.info;
    if (target.every((coordinate) => coordinate === null)) return null;
    const offsets = target.map((coordinate, axis) => (coordinate === null ? 0 : coordinate - center[axis]));
    return new Vector3(...offsets).applyMatrix4((this.#ui as PlayerParts).view.world.matrixWorld);
  }

  /** Apply the playback settings to a mesh. */
  #applySettings(mesh: ReelMesh, settings: PlayerSettings): void {
    const { loop, speed, interpolate, muted } = settings;
    try {
      Object.assign(mesh, { loop, speed, interpolate });
    } catch (error) {
      this.#reportError(error as Error);
    }
    if (mesh.video) mesh.video.muted = muted;
  }

  async #applyAppearance(mesh: ReelMesh, settings: PlayerSettings): Promise<void> {
    const { offset, muted } = settings;
    const texture = settings.texture ?? this.#video;
    const kind = texture === this.#video ? "video" : settings.kind;
    const { track, component, range, map } = settings;
    this.#ui?.legend.show(null);
    try {
      if (track === null) await mesh.setTexture(texture, { kind, offset, muted });
      else {
        const legend = await mesh.colorBy(track, { component, range, map });
        const title = trackTitle(track, legend.component, mesh.reel.track(track).info.nColumns);
        this.#ui?.legend.show({ ...legend, title });
      }
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
    mesh.addEventListener("frame", ({ frame }) => {
      const { start, nFrames } = this.#failure?.frames ?? { start: 0, nFrames: 0 };
      if (frame >= start && frame < start + nFrames) this.#clearError();
      this.#ui?.view.invalidate();
      this.#updateUi();
      this.dispatchEvent(new Event("timeupdate"));
    });
    for (const type of ["waiting", "playing", "ended", "progress"] as const) {
      mesh.addEventListener(type, () => {
        if (type === "ended") this.#hasEnded = true;
        this.#updateUi();
        this.dispatchEvent(new Event(type));
      });
    }
    mesh.addEventListener("warning", ({ message }) => {
      console.warn(`<reel-player>: ${message}`);
      this.#isAutoplayBlocked = !mesh.isPlaying;
      if (!mesh.isPlaying) this.#rejectPlay(new DOMException(message, "NotAllowedError"));
      this.#updateUi();
      this.dispatchEvent(new CustomEvent("warning", { detail: { message } }));
    });
    mesh.addEventListener("error", ({ error, block, frames, track }) => {
      if (block === null) return this.#reportError(error);
      const { start, nFrames } = frames ?? mesh.reel.info.blocks[block];
      const retry = () => {
        if (track === undefined) mesh.retry();
        else if (this.#ui?.retryTrack) this.#ui.retryTrack();
        else this.#retryAppearance(mesh);
      };
      const prefix = `Frames ${start} to ${start + nFrames - 1} are missing: `;
      this.#reportError(error, { prefix, retry, frames });
    });
  }

  /** Close the file, or cancel opening it. */
  #close(): void {
    const mesh = this.#mesh;
    if (mesh || this.#loading) {
      this.#rejectPlay(new DOMException("the file was replaced or removed", "AbortError"));
    }
    this.#lazyObserver?.disconnect();
    this.#lazyObserver = null;
    this.#loading?.abort();
    this.#loading = null;
    this.#isSuspended = this.#isAutoplayBlocked = this.#isSeeking = this.#hasEnded = false;
    this.#mesh = null;
    if (this.#video) URL.revokeObjectURL(this.#video);
    this.#video = null;
    if (mesh) {
      this.#ui?.legend.show(null);
      this.#ui?.view.remove(mesh);
      mesh.dispose();
    }
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
    else this.#start();
  }

  /** Play; what prevents it is displayed. */
  #start(): void {
    this.play().catch(() => {});
  }

  /** Pause, and move by a number of frames; while looping, past the end to the start. */
  #step(nFrames: number): void {
    const mesh = this.#requireMesh();
    this.pause();
    const wraps = mesh.loop === true && Math.abs(nFrames) === 1;
    const frame = mesh.frame + nFrames;
    this.seek({ frame: wraps ? (frame + mesh.nFrames) % mesh.nFrames : frame });
  }

  /** Whether the camera rotates on its own. */
  get #isAutoRotating(): boolean {
    return !!this.#settings?.autoRotate && !prefersReducedMotion();
  }

  #rejectPlay(error: Error): void {
    this.#isPlayPending = false;
    for (const { reject } of this.#playRequests.splice(0)) reject(error);
  }

  /** Settle promises of `play` and seeks whose picture is available. */
  #settle(mesh: ReelMesh): void {
    if (this.#isPlaying && (this.#isSuspended || !mesh.isWaiting)) {
      for (const { resolve } of this.#playRequests.splice(0)) resolve();
    }
    if (!this.#isSeeking || mesh.isWaiting) return;
    this.#isSeeking = false;
    this.#dispatchLater("seeked");
  }

  /** Dispatch an event after the running script, which may add listeners first, as to a video. */
  #dispatchLater(type: string): void {
    queueMicrotask(() => this.dispatchEvent(new Event(type)));
  }

  /** Update the user interface; dispatch `play` or `pause` if that has changed. */
  #updateUi(): void {
    if (!this.#ui) return;
    const { view, bar, start, messages, poster } = this.#ui;
    const mesh = this.#mesh;
    const isPlaying = this.#isPlaying;
    if (mesh) this.#settle(mesh);
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
    const { view, bar } = this.#ui;
    const { key } = event;
    const target = event.composedPath()[0];
    const isButton = target instanceof HTMLButtonElement;
    const isTimeline = target === bar.timeline;
    if (target !== view.canvas && !isButton && !isTimeline) return; // such as fields of the page
    // A focused button handles the space bar, and the timeline its own keys.
    const isHandled =
      key === " "
        ? !isButton && this.#run(() => this.#toggle())
        : !(isTimeline && key.length > 1) && (view.camera.handleKey(key) || this.#seekByKey(key));
    if (isHandled) event.preventDefault();
  }

  /** Seek by a key press; returns false for other keys. */
  #seekByKey(key: string): boolean {
    const moves: Record<string, () => void> = {
      Home: () => this.seek({ frame: 0 }),
      End: () => this.seek({ frame: this.#requireMesh().nFrames - 1 }),
      ArrowLeft: () => this.#step(-1),
      ArrowRight: () => this.#step(1),
      ",": () => this.#step(-1),
      ".": () => this.#step(1),
    };
    return key in moves && this.#run(moves[key]);
  }

  #run(action: () => void): true {
    action();
    return true;
  }
}

/** Return the address of an MP4 file; that of an object is to be revoked. */
function addressOf(from: SourceInput): string {
  if (typeof from === "string" || from instanceof URL) return String(from);
  return URL.createObjectURL(new Blob([from as BlobPart], { type: "video/mp4" }));
}

function barState(mesh: ReelMesh, isPlaying: boolean): BarState {
  const { frame, nFrames, time, duration, speed, video } = mesh;
  return { isPlaying, frame, nFrames, time, duration, speed, isMuted: video?.muted ?? null };
}

function prefersReducedMotion(): boolean {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}

function isEqual(value: unknown, other: unknown): boolean {
  return JSON.stringify(value) === JSON.stringify(other);
}

/** @throws InvalidInputError if a value is not a CSS color. */
function requireColor(value: string | null): void {
  if (value === null || CSS.supports("color", value)) return;
  throw new InvalidInputError(`background must be a CSS color; got background="${value}"`);
}
