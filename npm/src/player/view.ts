// The picture of a player: a canvas, drawn when something has changed and can be seen.

import {
  DirectionalLight,
  HemisphereLight,
  type Mesh,
  Scene,
  WebGLRenderer,
} from "three";

import { MeshReelError } from "../errors.js";
import { PlayerCamera } from "./camera.js";
import { type ContextHolder, giveContextBack, takeContext } from "./contexts.js";
import { studioTexture, WHITEST } from "./studio.js";

/** Pixels of the canvas for one of CSS, at most: more are not seen, but cost. */
const MOST_DENSE = 2;

/** Most seconds between two pictures that are played: a page that slept does not jump. */
const LONGEST_S = 0.25;

/** What a view asks and tells. */
export interface Viewed {
  /** Whether time passes, so that pictures follow one another. */
  isMoving(): boolean;
  /** Whether the picture of the time is there. */
  hasPicture(): boolean;
  /** Seconds have passed since the last picture. */
  pass(seconds: number): void;
  /** Whether it can be seen has changed. */
  onSeen(isSeen: boolean): void;
  onError(error: Error): void;
  /** The browser took the graphics away; `onRestored` follows if it gives them back. */
  onLost(error: Error): void;
  onRestored(): void;
}

/** A canvas with a scene. */
export class View implements ContextHolder {
  readonly canvas = document.createElement("canvas");
  readonly camera: PlayerCamera;
  readonly #viewed: Viewed;
  readonly #scene = new Scene();
  readonly #sky = new HemisphereLight(0xffffff, 0x8a8f98, Math.PI / 2);
  readonly #resizing: ResizeObserver;
  readonly #looking: IntersectionObserver;
  readonly #listening = new AbortController();
  #renderer: WebGLRenderer | null = null;
  /** Whether the context is in use, being given back, or given back. */
  #context: "used" | "leaving" | "resting" = "used";
  /** The last picture, while there is no context to draw another. */
  #still: HTMLCanvasElement | null = null;
  #isSeen = false;
  #isStale = true;
  #hasFailed = false;
  #asked: number | null = null;
  #last = 0;

  /** @param parent - gets the canvas, and gives it its size */
  constructor(parent: HTMLElement, viewed: Viewed) {
    this.#viewed = viewed;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    parent.prepend(this.canvas);
    this.camera = new PlayerCamera(this.canvas, () => this.invalidate());
    this.#light();
    this.#resizing = new ResizeObserver(() => this.#resize());
    this.#resizing.observe(this.canvas);
    this.#looking = new IntersectionObserver(([...entries]) => {
      this.#see(entries.at(-1)?.isIntersecting ?? false);
    });
    this.#looking.observe(this.canvas);
    const { signal } = this.#listening;
    const lost = (event: Event) => {
      event.preventDefault(); // so that it may come back
      if (this.#context === "leaving") {
        this.#context = "resting";
        if (this.#isSeen) this.#wakeContext();
        return;
      }
      const message = "the browser took the graphics away from this player, and may give them back";
      viewed.onLost(new MeshReelError(message));
    };
    const restored = () => {
      this.#context = "used";
      viewed.onRestored();
      this.invalidate();
    };
    this.canvas.addEventListener("webglcontextlost", lost, { signal });
    this.canvas.addEventListener("webglcontextrestored", restored, { signal });
  }

  /** What draws, once it could be seen; null before, and where there is no WebGL 2. */
  get renderer(): WebGLRenderer | null {
    return this.#renderer;
  }

  /** Whether any of it is in the window. */
  get isSeen(): boolean {
    return this.#isSeen;
  }

  /** Metals get something to reflect, in place of the light from above that others have. */
  add(mesh: Mesh): void {
    const hasMetal = [mesh.material].flat().some((one) => "metalness" in one && one.metalness);
    this.#scene.environment = hasMetal ? studioTexture() : null;
    this.#scene.environmentIntensity = WHITEST;
    this.#sky.visible = !hasMetal;
    this.#scene.add(mesh);
    this.invalidate();
  }

  remove(mesh: Mesh): void {
    this.#scene.environment?.dispose();
    this.#scene.environment = null;
    mesh.removeFromParent();
    this.invalidate();
  }

  /** Draws anew before long. */
  invalidate(): void {
    this.#isStale = true;
    this.wake();
  }

  /** Begins to draw, if something moves or has changed. */
  wake(): void {
    if (this.#asked !== null || !this.#isSeen || !this.#renderer) return;
    if (this.#context !== "used") return;
    if (!this.#isStale && !this.#viewed.isMoving()) return;
    this.#last ||= performance.now();
    this.#asked = requestAnimationFrame((now) => this.#tick(now));
  }

  /** Gives the context of WebGL back until it is seen again; the last picture stays. */
  rest(): void {
    const renderer = this.#renderer;
    if (!renderer || this.#context !== "used" || renderer.getContext().isContextLost()) return;
    renderer.render(this.#scene, this.camera.camera); // what was drawn before is not kept
    const still = document.createElement("canvas");
    [still.width, still.height] = [this.canvas.width, this.canvas.height];
    still.getContext("2d")?.drawImage(this.canvas, 0, 0);
    still.className = "still";
    this.#still?.remove();
    this.#still = still;
    this.canvas.after(still);
    this.#context = "leaving";
    renderer.forceContextLoss();
  }

  /** Frees all that it has made; it must not be used any more. */
  dispose(): void {
    giveContextBack(this);
    this.#still?.remove();
    this.#listening.abort();
    this.#resizing.disconnect();
    this.#looking.disconnect();
    if (this.#asked !== null) cancelAnimationFrame(this.#asked);
    this.camera.dispose();
    this.#renderer?.dispose();
    // Browsers have few contexts, and are slow to free them.
    if (this.#context === "used") this.#renderer?.forceContextLoss();
    this.#renderer = null;
    this.canvas.remove();
  }

  /** The sum of light on a white surface that faces the camera is white. */
  #light(): void {
    const { camera } = this.camera;
    const key = new DirectionalLight(0xffffff, Math.PI / 2);
    key.position.set(-0.5, 1, 2);
    camera.add(key, key.target);
    this.#scene.add(this.#sky, camera);
  }

  #see(isSeen: boolean): void {
    if (isSeen === this.#isSeen) return;
    this.#isSeen = isSeen;
    if (isSeen && !this.#renderer && !this.#hasFailed) this.#start();
    else if (isSeen) this.#wakeContext();
    this.#viewed.onSeen(isSeen);
    this.wake();
  }

  /** Takes a context again where it was given back. */
  #wakeContext(): void {
    if (!this.#renderer) return;
    takeContext(this); // also where it has one: it is the one seen last
    if (this.#context === "resting") this.#renderer.forceContextRestore();
  }

  #start(): void {
    takeContext(this);
    try {
      this.#renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
      this.#resize();
    } catch (error) {
      giveContextBack(this);
      this.#hasFailed = true;
      const reason = error instanceof Error ? error.message : String(error);
      const words = `this browser gives no WebGL 2, which draws the player (${reason})`;
      this.#viewed.onError(new MeshReelError(words));
    }
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (!this.#renderer || !clientWidth || !clientHeight) return;
    this.#renderer.setPixelRatio(density());
    this.#renderer.setSize(clientWidth, clientHeight, false);
    this.camera.reshape(clientWidth / clientHeight);
    this.invalidate();
  }

  #tick(now: number): void {
    this.#asked = null;
    if (!this.#renderer || this.#context !== "used") return;
    if (this.#renderer.getPixelRatio() !== density()) this.#resize();
    this.#viewed.pass(Math.min(Math.max(now - this.#last, 0) / 1000, LONGEST_S));
    this.#last = now;
    if (this.#isStale) {
      this.#isStale = false;
      this.#renderer.render(this.#scene, this.camera.camera);
      if (this.#still && this.#viewed.hasPicture()) {
        this.#still.remove();
        this.#still = null;
      }
    }
    this.wake();
    if (this.#asked === null) this.#last = 0;
  }
}

function density(): number {
  return Math.min(devicePixelRatio, MOST_DENSE);
}
