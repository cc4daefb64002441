// The canvas of a player, which is redrawn only when it has changed and is visible.

import { MeshReelError } from "../errors.js";
import {
  Group,
  type Mesh,
  type Object3D,
  Raycaster,
  Scene,
  Vector3,
  WebGLRenderer,
} from "../webgl/index.js";
import { type CameraPose, PlayerCamera } from "./camera.js";
import { ContactShadow } from "./contact_shadow.js";
import { type ContextHolder, releaseContext, acquireContext } from "./context_pool.js";

/** Limit of canvas pixels per CSS pixel: more take time without a visible gain. */
const MAX_PIXEL_RATIO = 2;

/** Limit of the time step between two redraws: playback does not jump after the page slept. */
const MAX_STEP_S = 0.25;

/** Radius of the depth range, relative to that of the model: it may move out of its box. */
const DEPTH_RATIO = 2;

/** State and callbacks that a view needs from the player. */
export interface ViewDelegate {
  /** Whether time advances, so that the canvas must be redrawn continuously. */
  isAnimating(): boolean;
  /** Whether the current frame is ready to be drawn. */
  hasPicture(): boolean;
  /** Called before each redraw with the seconds since the last one. */
  advance(seconds: number): void;
  onVisibilityChange(isVisible: boolean): void;
  onCameraChange(isByUser: boolean): void;
  onError(error: Error): void;
  /** The WebGL context was lost; `onContextRestored` follows if the browser restores it. */
  onContextLost(error: Error): void;
  onContextRestored(): void;
}

/** A mesh that the camera can follow. */
export interface Followed {
  /** Set a vector to the mean of the vertices, and return it. */
  getCentroid(target: Vector3): Vector3;
}

/** A canvas with a scene. */
export class View implements ContextHolder {
  readonly canvas = document.createElement("canvas");
  readonly camera: PlayerCamera;
  readonly #delegate: ViewDelegate;
  /** Contains `model`; its rotation turns the up axis of the file to y. */
  readonly world = new Group();
  /** Contains the meshes; its position is that of the center of the file. */
  readonly model = new Group();
  /** Called before each drawing. */
  onDraw: (() => void) | null = null;
  /** Largest distance of the model from the center of the file, from which the depth range follows. */
  radius = 1;
  readonly #scene = new Scene();
  readonly #shadow = new ContactShadow();
  #followed: Followed | null = null;
  /** Objects of `model` in each of several views; null: one view of all. */
  #panes: readonly (readonly Object3D[])[] | null = null;
  readonly #resizeObserver: ResizeObserver;
  readonly #visibilityObserver: IntersectionObserver;
  readonly #listeners = new AbortController();
  #renderer: WebGLRenderer | null = null;
  #context: "active" | "releasing" | "released" = "active";
  /** A copy of the last drawn frame, shown while there is no context. */
  #snapshot: HTMLCanvasElement | null = null;
  #isVisible = false;
  #isStale = true;
  #hasFailed = false;
  #frameRequest: number | null = null;
  #lastTime = 0;

  /** @param parent - the element to which the canvas is added and whose size it takes */
  constructor(parent: HTMLElement, delegate: ViewDelegate) {
    this.#delegate = delegate;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    parent.prepend(this.canvas);
    this.camera = new PlayerCamera(this.canvas, (isByUser) => {
      this.invalidate();
      delegate.onCameraChange(isByUser);
    });
    this.world.add(this.model);
    this.#scene.add(this.camera.camera, this.world, this.#shadow.floor);
    this.#resizeObserver = new ResizeObserver(() => this.#resize());
    this.#resizeObserver.observe(this.canvas);
    this.#visibilityObserver = new IntersectionObserver(([...entries]) => {
      this.#setVisible(entries.at(-1)?.isIntersecting ?? false);
    });
    this.#visibilityObserver.observe(this.canvas);
    const { signal } = this.#listeners;
    const lost = (event: Event) => {
      event.preventDefault(); // allows the browser to restore it
      if (this.#context === "releasing") {
        this.#context = "released";
        if (this.#isVisible) this.#reacquireContext();
        return;
      }
      const message = "the browser dropped the WebGL context of this player; it may restore it";
      delegate.onContextLost(new MeshReelError(message));
    };
    const restored = () => {
      this.#context = "active";
      delegate.onContextRestored();
      this.invalidate();
    };
    this.canvas.addEventListener("webglcontextlost", lost, { signal });
    this.canvas.addEventListener("webglcontextrestored", restored, { signal });
  }

  /** The renderer; null before the view was visible for the first time, and without WebGL 2. */
  get renderer(): WebGLRenderer | null {
    return this.#renderer;
  }

  /** Whether any part of the canvas is in the viewport. */
  get isVisible(): boolean {
    return this.#isVisible;
  }

  add(mesh: Mesh): void {
    this.model.add(mesh);
    this.invalidate();
  }

  /** Keep the centroid of a mesh at the origin; null: the center of the file. */
  follow(mesh: Followed | null): void {
    this.#followed = mesh;
    if (!mesh) this.model.position.set(0, 0, 0);
  }

  /**
   * Frame points from an initial view.
   *
   * @param swept - points of all frames: the lowest is on the floor
   */
  frame(points: readonly Vector3[], swept: readonly Vector3[], pose: CameraPose): void {
    this.camera.frame(points, pose);
    this.#shadow.place(points, swept);
    if (this.#panes) this.#updateAspect();
  }

  /** Show several views with the same camera, each with some objects of `model`; null: one view. */
  setPanes(panes: readonly (readonly Object3D[])[] | null): void {
    this.#panes = panes;
    if (!panes) for (const object of this.model.children) object.visible = true;
    this.#updateAspect();
    this.invalidate();
  }

  get #nViews(): number {
    return this.#panes?.length ?? 1;
  }

  /**
   * Whether several views are stacked vertically: if that shows the model larger. Depends on the size
   * of the player rather than of the canvas, which changes with the legend.
   */
  get isPortrait(): boolean {
    if (this.#nViews === 1) return false;
    const [beside, stacked] = this.#sizes();
    return stacked > beside;
  }

  /** Size of points if the camera framed them, in the arrangement of the views that shows them larger. */
  sizeOf(points: readonly Vector3[]): number {
    return Math.max(...this.#sizes(points));
  }

  /** Sizes of points, by default the framed ones, in views side by side and, if there are several, stacked. */
  #sizes(points?: readonly Vector3[]): number[] {
    const { camera } = this;
    const n = this.#nViews;
    if (n === 1) return [1 / camera.distanceTo(points)];
    const { clientWidth, clientHeight } = (this.canvas.getRootNode() as ShadowRoot).host;
    return [
      camera.scaleIn(clientWidth / n, clientHeight, points),
      camera.scaleIn(clientWidth, clientHeight / n, points),
    ];
  }

  /** Return the ray through a position on the page; null outside of the canvas. */
  rayAt(clientX: number, clientY: number): Raycaster | null {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const n = this.#nViews;
    const [w, h] = this.isPortrait ? [width, height / n] : [width / n, height];
    const [x, y] = [clientX - left, clientY - top];
    if (!(x >= 0 && x < width && y >= 0 && y < height)) return null;
    return Raycaster.fromCamera((2 * (x % w)) / w - 1, 1 - (2 * (y % h)) / h, this.camera.camera);
  }

  remove(mesh: Mesh): void {
    mesh.removeFromParent();
    this.follow(null);
    this.invalidate();
  }

  /** Draw at once, such as to read the canvas afterwards. */
  drawNow(): void {
    this.#isStale = false;
    const renderer = this.#renderer;
    if (!renderer) return;
    this.#followed?.getCentroid(this.model.position).negate();
    this.onDraw?.();
    const radius = DEPTH_RATIO * this.radius;
    const center = this.model.getWorldPosition(new Vector3());
    this.camera.setDepthRange(center, radius);
    const { width, height } = this.canvas;
    const ratio = renderer.getPixelRatio();
    const panes = this.#panes ?? [this.model.children];
    const [n, w, h] = [panes.length, width / ratio, height / ratio];
    const { isPortrait } = this;
    panes.forEach((objects, i) => {
      if (this.#panes) for (const object of this.model.children) object.visible = objects.includes(object);
      this.#shadow.update(renderer, this.#scene, center.y);
      if (isPortrait) renderer.setViewport(0, h - ((i + 1) * h) / n, w, h / n, n > 1);
      else renderer.setViewport((i * w) / n, 0, w / n, h, n > 1);
      renderer.render(this.#scene, this.camera.camera);
    });
  }

  /** Request a redraw. */
  invalidate(): void {
    this.#isStale = true;
    this.scheduleFrame();
  }

  /** Schedule a redraw if the view is animating or has changed. */
  scheduleFrame(): void {
    if (this.#frameRequest !== null || !this.#isVisible || !this.#renderer) return;
    if (this.#context !== "active") return;
    if (!this.#isStale && !this.#delegate.isAnimating()) return;
    this.#lastTime ||= performance.now();
    this.#frameRequest = requestAnimationFrame((now) => this.#tick(now));
  }

  /** Release the WebGL context until the view is visible again; a snapshot stays. */
  suspend(): void {
    const renderer = this.#renderer;
    if (!renderer || this.#context !== "active" || renderer.getContext().isContextLost()) return;
    this.drawNow(); // the drawing buffer is not preserved
    const snapshot = document.createElement("canvas");
    [snapshot.width, snapshot.height] = [this.canvas.width, this.canvas.height];
    snapshot.getContext("2d")?.drawImage(this.canvas, 0, 0);
    snapshot.className = "snapshot";
    this.#snapshot?.remove();
    this.#snapshot = snapshot;
    this.canvas.after(snapshot);
    this.#context = "releasing";
    renderer.forceContextLoss();
  }

  /** Free all resources; the view must not be used afterwards. */
  dispose(): void {
    releaseContext(this);
    this.#snapshot?.remove();
    this.#listeners.abort();
    this.#resizeObserver.disconnect();
    this.#visibilityObserver.disconnect();
    if (this.#frameRequest !== null) cancelAnimationFrame(this.#frameRequest);
    this.camera.dispose();
    this.#renderer?.dispose();
    // Contexts are scarce, and browsers free them late.
    if (this.#context === "active") this.#renderer?.forceContextLoss();
    this.#renderer = null;
    this.canvas.remove();
  }

  #setVisible(isSeen: boolean): void {
    if (isSeen === this.#isVisible) return;
    this.#isVisible = isSeen;
    if (isSeen && !this.#renderer && !this.#hasFailed) this.#createRenderer();
    else if (isSeen) this.#reacquireContext();
    this.#delegate.onVisibilityChange(isSeen);
    this.scheduleFrame();
  }

  /** Restore the context if it was released. */
  #reacquireContext(): void {
    if (!this.#renderer) return;
    acquireContext(this); // even if it has one: marks it as the one visible last
    if (this.#context === "released") this.#renderer.forceContextRestore();
  }

  #createRenderer(): void {
    acquireContext(this);
    try {
      this.#renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
      this.#resize();
    } catch (error) {
      releaseContext(this);
      this.#hasFailed = true;
      const reason = error instanceof Error ? error.message : String(error);
      const message = `the player needs WebGL 2, which this browser does not support (${reason})`;
      this.#delegate.onError(new MeshReelError(message));
    }
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (!this.#renderer || !clientWidth || !clientHeight) return;
    this.#renderer.setPixelRatio(pixelRatio());
    this.#renderer.setSize(clientWidth, clientHeight);
    this.#updateAspect();
    this.invalidate();
  }

  #updateAspect(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    const n = this.#nViews;
    const aspect = clientWidth / clientHeight;
    this.camera.setAspect(this.isPortrait ? aspect * n : aspect / n);
  }

  #tick(now: number): void {
    this.#frameRequest = null;
    if (!this.#renderer || this.#context !== "active") return;
    if (this.#renderer.getPixelRatio() !== pixelRatio()) this.#resize();
    this.#delegate.advance(Math.min(Math.max(now - this.#lastTime, 0) / 1000, MAX_STEP_S));
    this.#lastTime = now;
    if (this.#isStale) {
      this.drawNow();
      if (this.#snapshot && this.#delegate.hasPicture()) {
        this.#snapshot.remove();
        this.#snapshot = null;
      }
    }
    this.scheduleFrame();
    if (this.#frameRequest === null) this.#lastTime = 0;
  }
}

function pixelRatio(): number {
  return Math.min(devicePixelRatio, MAX_PIXEL_RATIO);
}
