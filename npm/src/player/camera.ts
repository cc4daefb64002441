// The camera of a player: where it stands, and how it is moved.

import { PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

import type { Reach } from "./reach.js";

/** Field of view upwards, in degrees. */
const FOV = 30;

/** From where it looks at first: a little from above. */
const FROM = new Vector3(0, 0.2, 1).normalize();

/** Share of the picture that a box fills; the rest is a margin. */
const FILLED = 0.95;

/** A press of a key turns it by this angle, in radians, or comes nearer by this factor. */
const TURN = Math.PI / 18;
const STEP = 1.15;

/** Distances that people may take, of that from which all is seen. */
const [NEAREST, FARTHEST] = [0.1, 4];

/** A camera that sees a box around the origin, and turns around it. */
export class PlayerCamera {
  readonly camera = new PerspectiveCamera(FOV);
  readonly #canvas: HTMLCanvasElement;
  readonly #onMoved: () => void;
  readonly #listening = new AbortController();
  #controls: OrbitControls | null = null;
  #reach: Reach = [1, 1, 1];
  #isMoved = false;

  /** @param onMoved - is told when people have moved it */
  constructor(canvas: HTMLCanvasElement, onMoved: () => void) {
    this.#canvas = canvas;
    this.#onMoved = onMoved;
    // The wheel scrolls the page, until the picture has been chosen or a key says what is meant.
    const parent = canvas.parentElement as HTMLElement;
    const keep = (event: WheelEvent) => {
      const root = canvas.getRootNode() as ShadowRoot;
      const isMeant = root.activeElement === canvas || event.ctrlKey || event.metaKey;
      if (!isMeant) event.stopPropagation();
    };
    parent.addEventListener("wheel", keep, { capture: true, signal: this.#listening.signal });
  }

  /** Whether people can move it. */
  set hasControls(has: boolean) {
    if (has === (this.#controls !== null)) return;
    if (!has) {
      this.#controls?.dispose();
      this.#controls = null;
      return;
    }
    const controls = new OrbitControls(this.camera, this.#canvas);
    this.#canvas.style.touchAction = "pan-y"; // a finger that goes up scrolls the page
    this.#limit(controls);
    controls.addEventListener("change", this.#onMoved);
    controls.addEventListener("start", () => {
      this.#isMoved = true;
    });
    this.#controls = controls;
  }

  /** Looks at a box around the origin, y upwards, so that all of it is seen. */
  fit(reach: Reach): void {
    this.#reach = reach;
    const radius = Math.hypot(...reach);
    this.camera.near = radius / 100;
    this.camera.far = 100 * radius;
    this.reset();
  }

  /** Goes back to where it was at first. */
  reset(): void {
    this.#isMoved = false;
    this.camera.position.copy(FROM).multiplyScalar(this.#distance);
    this.camera.updateProjectionMatrix();
    this.camera.lookAt(0, 0, 0);
    if (this.#controls) {
      this.#limit(this.#controls);
      this.#controls.target.set(0, 0, 0);
      this.#controls.update();
    }
    this.#onMoved();
  }

  /** Sees a picture of another shape; what people have chosen stays. */
  reshape(aspect: number): void {
    this.camera.aspect = aspect;
    if (this.#isMoved) this.camera.updateProjectionMatrix();
    else this.reset();
  }

  /** Does what a key says; false where it says nothing to cameras. */
  press(key: string): boolean {
    const controls = this.#controls;
    if (!controls) return false;
    const moves: Record<string, () => void> = {
      ArrowLeft: () => controls.rotateLeft(TURN),
      ArrowRight: () => controls.rotateLeft(-TURN),
      ArrowUp: () => controls.rotateUp(TURN),
      ArrowDown: () => controls.rotateUp(-TURN),
      "+": () => controls.dollyIn(STEP),
      "-": () => controls.dollyOut(STEP),
      "0": () => this.reset(),
    };
    if (!(key in moves)) return false;
    this.#isMoved = key !== "0";
    moves[key]();
    return true;
  }

  dispose(): void {
    this.#listening.abort();
    this.hasControls = false;
  }

  /** From where the box fills the picture: that from which each of its corners is seen. */
  get #distance(): number {
    const upwards = FILLED * Math.tan((FOV * Math.PI) / 360);
    const sideways = upwards * this.camera.aspect;
    const [x, y, z] = this.#reach;
    const corners = [y, -y].flatMap((y) => [z, -z].map((z) => [y, z]));
    const distances = corners.map(([y, z]) => {
      const nearer = y * FROM.y + z * FROM.z;
      const higher = Math.abs(y * FROM.z - z * FROM.y);
      return nearer + Math.max(x / sideways, higher / upwards);
    });
    return Math.max(...distances);
  }

  #limit(controls: OrbitControls): void {
    controls.minDistance = NEAREST * this.#distance;
    controls.maxDistance = FARTHEST * this.#distance;
  }
}
