// The camera of a player and its controls.

import { PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

import type { HalfExtents } from "./half_extents.js";

/** Vertical field of view, in degrees. */
const FOV = 30;

/** Direction from the model to the initial camera: slightly above. */
const VIEW_DIRECTION = new Vector3(0, 0.2, 1).normalize();

/** Fraction of the canvas that the model fills; the rest is a margin. */
const FILL_RATIO = 0.95;

/** Rotation in radians, and zoom factor, of a key press. */
const ROTATION_STEP = Math.PI / 18;
const ZOOM_FACTOR = 1.15;

/** Limits of the distance, relative to the one that frames the model. */
const [MIN_DISTANCE, MAX_DISTANCE] = [0.1, 4];

/** A camera that frames a box around the origin and orbits around it. */
export class PlayerCamera {
  readonly camera = new PerspectiveCamera(FOV);
  readonly #canvas: HTMLCanvasElement;
  readonly #onChange: () => void;
  readonly #listeners = new AbortController();
  #controls: OrbitControls | null = null;
  #extents: HalfExtents = [1, 1, 1];
  #isUserControlled = false;

  /** @param onChange - called when the user moves the camera */
  constructor(canvas: HTMLCanvasElement, onChange: () => void) {
    this.#canvas = canvas;
    this.#onChange = onChange;
    // The wheel scrolls the page, unless the canvas has the focus or Ctrl (Cmd) is pressed.
    const parent = canvas.parentElement as HTMLElement;
    const filterWheel = (event: WheelEvent) => {
      const root = canvas.getRootNode() as ShadowRoot;
      const isZoom = root.activeElement === canvas || event.ctrlKey || event.metaKey;
      if (!isZoom) event.stopPropagation();
    };
    parent.addEventListener("wheel", filterWheel, { capture: true, signal: this.#listeners.signal });
  }

  /** Whether the user can move the camera. */
  set hasControls(has: boolean) {
    if (has === (this.#controls !== null)) return;
    if (!has) {
      this.#controls?.dispose();
      this.#controls = null;
      return;
    }
    const controls = new OrbitControls(this.camera, this.#canvas);
    this.#canvas.style.touchAction = "pan-y"; // vertical swipes scroll the page
    this.#limitDistance(controls);
    controls.addEventListener("change", this.#onChange);
    controls.addEventListener("start", () => {
      this.#isUserControlled = true;
    });
    this.#controls = controls;
  }

  /** Frame a box around the origin, with y up. */
  fit(extents: HalfExtents): void {
    this.#extents = extents;
    const radius = Math.hypot(...extents);
    this.camera.near = radius / 100;
    this.camera.far = 100 * radius;
    this.reset();
  }

  /** Return to the initial view. */
  reset(): void {
    this.#isUserControlled = false;
    this.camera.position.copy(VIEW_DIRECTION).multiplyScalar(this.#distance);
    this.camera.updateProjectionMatrix();
    this.camera.lookAt(0, 0, 0);
    if (this.#controls) {
      this.#limitDistance(this.#controls);
      this.#controls.target.set(0, 0, 0);
      this.#controls.update();
    }
    this.#onChange();
  }

  /** Set the aspect ratio; a view that the user has chosen is kept. */
  setAspect(aspect: number): void {
    this.camera.aspect = aspect;
    if (this.#isUserControlled) this.camera.updateProjectionMatrix();
    else this.reset();
  }

  /** Apply a key press; returns false if the key does not move the camera. */
  handleKey(key: string): boolean {
    const controls = this.#controls;
    if (!controls) return false;
    const moves: Record<string, () => void> = {
      ArrowLeft: () => controls.rotateLeft(ROTATION_STEP),
      ArrowRight: () => controls.rotateLeft(-ROTATION_STEP),
      ArrowUp: () => controls.rotateUp(ROTATION_STEP),
      ArrowDown: () => controls.rotateUp(-ROTATION_STEP),
      "+": () => controls.dollyIn(ZOOM_FACTOR),
      "-": () => controls.dollyOut(ZOOM_FACTOR),
      "0": () => this.reset(),
    };
    if (!(key in moves)) return false;
    this.#isUserControlled = key !== "0";
    moves[key]();
    return true;
  }

  dispose(): void {
    this.#listeners.abort();
    this.hasControls = false;
  }

  /** Distance at which the box fills the canvas: the smallest one that shows all of its corners. */
  get #distance(): number {
    const upwards = FILL_RATIO * Math.tan((FOV * Math.PI) / 360);
    const sideways = upwards * this.camera.aspect;
    const [x, y, z] = this.#extents;
    const corners = [y, -y].flatMap((y) => [z, -z].map((z) => [y, z]));
    const distances = corners.map(([y, z]) => {
      const nearer = y * VIEW_DIRECTION.y + z * VIEW_DIRECTION.z;
      const higher = Math.abs(y * VIEW_DIRECTION.z - z * VIEW_DIRECTION.y);
      return nearer + Math.max(x / sideways, higher / upwards);
    });
    return Math.max(...distances);
  }

  #limitDistance(controls: OrbitControls): void {
    controls.minDistance = MIN_DISTANCE * this.#distance;
    controls.maxDistance = MAX_DISTANCE * this.#distance;
  }
}
