// The camera of a player and its controls.

import { PerspectiveCamera, Vector3 } from "../webgl/index.js";
import { boundsOf } from "./framing.js";
import { type CameraOrbit, MIN_PHI, OrbitControls, sphericalAround } from "./orbit_controls.js";
import type { CameraSettings } from "./settings.js";

/** Fraction of the canvas that the model fills; the rest is a margin. */
const FILL_RATIO = 0.93;

/** Rotation in radians, and zoom factor, of a key press. */
const ROTATION_STEP = Math.PI / 18;
const ZOOM_FACTOR = 1.15;

/** Limits of the distance, relative to the one that frames the model. */
const [MIN_DISTANCE, MAX_DISTANCE] = [0.02, 10];

/** Rotation without user input, in radians per second, and the pause after user input. */
const AUTO_ROTATION = Math.PI / 6;
const AUTO_ROTATION_DELAY_MS = 3000;

/** The initial view; the target is in the coordinates of the view, null: such that the points fill it. */
export interface CameraPose extends Omit<CameraSettings, "target"> {
  readonly target: Vector3 | null;
}

/** A camera that frames points and orbits around them, with y up. */
export class PlayerCamera {
  readonly camera = new PerspectiveCamera();
  /** The point that the camera orbits. */
  readonly target = new Vector3();
  readonly #canvas: HTMLCanvasElement;
  readonly #onChange: (isByUser: boolean) => void;
  /** Whether the wheel and vertical swipes move the camera even without the focus. */
  #zoomsAlways = false;
  readonly #listeners = new AbortController();
  #controls: OrbitControls | null = null;
  #points: readonly Vector3[] = [new Vector3()];
  #pose: CameraPose = { theta: 0, phi: Math.PI / 2, distance: null, zoom: 1, target: null, fieldOfView: 30 };
  #isUserControlled = false;
  /** Azimuth by which the camera has rotated on its own. */
  #turn = 0;
  #lastInputMs = -Infinity;

  /**
   * @param onChange - called when the camera moves
   */
  constructor(canvas: HTMLCanvasElement, onChange: (isByUser: boolean) => void) {
    this.#canvas = canvas;
    this.#onChange = onChange;
    // The wheel scrolls the page, unless the canvas has the focus or Ctrl (Cmd) is pressed.
    const parent = canvas.parentElement as HTMLElement;
    const filterWheel = (event: WheelEvent) => {
      const root = canvas.getRootNode() as ShadowRoot;
      const isZoom = this.#zoomsAlways || root.activeElement === canvas || event.ctrlKey || event.metaKey;
      if (!isZoom) event.stopPropagation();
    };
    parent.addEventListener("wheel", filterWheel, { capture: true, signal: this.#listeners.signal });
  }

  /**
   * Whether the wheel and vertical swipes always move the camera, as on pages that do not scroll;
   * else they scroll the page, the wheel unless the canvas has the focus.
   */
  set zoomsAlways(isOn: boolean) {
    this.#zoomsAlways = isOn;
    this.#canvas.style.touchAction = isOn ? "none" : "pan-y";
  }

  /** Whether the user can move the camera. */
  set hasControls(has: boolean) {
    if (has === (this.#controls !== null)) return;
    if (!has) {
      this.#controls?.dispose();
      this.#controls = null;
      this.#canvas.style.touchAction = "";
      return;
    }
    const onChange = () => this.#onChange(this.#isUserControlled);
    this.#controls = new OrbitControls(this.camera, this.#canvas, this.target, onChange, () => this.#takeInput());
    this.zoomsAlways = this.#zoomsAlways;
    this.#limitDistance();
  }

  /** Where the camera is. */
  get orbit(): CameraOrbit {
    return sphericalAround(this.target, this.camera.position);
  }

  /** Frame points from an initial view, by default that of the last call. */
  frame(points: readonly Vector3[], pose = this.#pose): void {
    [this.#points, this.#pose, this.#turn] = [points, pose, 0];
    this.reset();
  }

  /** Distance from the point that the camera would orbit if it framed points, by default the framed ones. */
  distanceTo(points?: readonly Vector3[]): number {
    const { eye, target } = this.#framing(points);
    return eye.distanceTo(target);
  }

  /** Size of such points in a view of this width and height, relative to that in other views. */
  scaleIn(width: number, height: number, points?: readonly Vector3[]): number {
    const { aspect } = this.camera;
    this.camera.aspect = width / height;
    const scale = height / this.distanceTo(points);
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    return scale;
  }

  /** Return to the initial view. */
  reset(): void {
    this.#isUserControlled = false;
    const { camera } = this;
    const { eye, target } = this.#framing();
    camera.position.copy(eye);
    this.target.copy(target);
    camera.lookAt(target);
    camera.updateMatrixWorld();
    this.#limitDistance();
    this.#controls?.update();
    this.#onChange(false);
  }

  /** Set the aspect ratio; a view that the user has chosen is kept. */
  setAspect(aspect: number): void {
    this.camera.aspect = aspect;
    if (this.#isUserControlled) this.camera.updateProjectionMatrix();
    else this.reset();
  }

  /** Rotate around the model, unless the user has just moved the camera. */
  autoRotate(seconds: number): void {
    if (performance.now() - this.#lastInputMs < AUTO_ROTATION_DELAY_MS) return;
    const angle = AUTO_ROTATION * seconds;
    this.#turn += angle;
    const { theta, phi, radius } = this.orbit;
    this.camera.position.setFromSphericalCoords(radius, phi, theta + angle).add(this.target);
    this.camera.lookAt(this.target);
    this.#onChange(false);
  }

  /** Set the near and the far plane around a sphere. */
  setDepthRange(center: Vector3, radius: number): void {
    const distance = this.camera.position.distanceTo(center);
    this.camera.near = Math.max(distance - radius, radius * 1e-3);
    this.camera.far = distance + radius;
    this.camera.updateProjectionMatrix();
  }

  /** Apply a key press; returns false if the key does not move the camera. */
  handleKey(key: string): boolean {
    const controls = this.#controls;
    if (!controls) return false;
    const moves: Record<string, () => void> = {
      ArrowLeft: () => controls.rotate(ROTATION_STEP, 0),
      ArrowRight: () => controls.rotate(-ROTATION_STEP, 0),
      ArrowUp: () => controls.rotate(0, ROTATION_STEP),
      ArrowDown: () => controls.rotate(0, -ROTATION_STEP),
      "+": () => controls.zoom(1 / ZOOM_FACTOR),
      "-": () => controls.zoom(ZOOM_FACTOR),
      "0": () => this.reset(),
    };
    if (!(key in moves)) return false;
    if (key !== "0") this.#takeInput();
    moves[key]();
    return true;
  }

  dispose(): void {
    this.#listeners.abort();
    this.hasControls = false;
  }

  #takeInput(): void {
    this.#isUserControlled = true;
    this.#lastInputMs = performance.now();
  }

  #limitDistance(): void {
    if (!this.#controls) return;
    const { eye, target } = this.#framing();
    const distance = eye.distanceTo(target);
    this.#controls.minDistance = MIN_DISTANCE * distance;
    this.#controls.maxDistance = MAX_DISTANCE * distance;
  }

  /** Compute the initial view of points, by default the framed ones. */
  #framing(points = this.#points): { eye: Vector3; target: Vector3 } {
    const { theta, phi, distance, zoom, target, fieldOfView } = this.#pose;
    this.camera.fov = fieldOfView;
    this.camera.updateProjectionMatrix();
    const polar = Math.min(Math.max(phi, MIN_PHI), Math.PI - MIN_PHI);
    const back = new Vector3().setFromSphericalCoords(1, polar, theta + this.#turn);
    const right = new Vector3().crossVectors(this.camera.up, back).normalize();
    const up = new Vector3().crossVectors(back, right);
    const slopeY = FILL_RATIO * this.camera.slope;
    const slopes = { right: slopeY * this.camera.aspect, up: slopeY };
    const center = target ?? middleOf(points);
    const local = points.map((point) => {
      const offset = point.clone().sub(center);
      return { right: offset.dot(right), up: offset.dot(up), depth: offset.dot(back) };
    });
    const [x, y] = (["right", "up"] as const).map((axis) => visibleFrom(local, axis, slopes[axis]));
    const nearest = Math.max(...local.map((point) => point.depth));
    const farthest = Math.min(...local.map((point) => point.depth));
    const clearance = nearest + (0.05 * (nearest - farthest) || 1);
    const aim = target ?? center.clone().addScaledVector(right, x.middle).addScaledVector(up, y.middle);
    const centered = target ? Math.max(x.centered, y.centered) : Math.max(x.depth, y.depth);
    const closest = Math.max(centered, clearance);
    const eye = aim.clone().addScaledVector(back, distance ?? zoom * closest);
    return { eye, target: aim };
  }
}

/** Middle of the bounding box of points. */
function middleOf(points: readonly Vector3[]): Vector3 {
  const { low, high } = boundsOf(points);
  return low.add(high).multiplyScalar(0.5);
}

interface LocalPoint {
  readonly right: number;
  readonly up: number;
  /** Along the axis from the target to the camera. */
  readonly depth: number;
}

/**
 * Where the camera must be so that points are in view along one axis. A point is in view of a camera
 * at `middle` and `depth` if |p - middle| <= slope (depth - p.depth): each side of the view gives one
 * maximum over all points. `centered` is the depth of a camera in the middle of the axis.
 */
function visibleFrom(
  points: readonly LocalPoint[],
  axis: "right" | "up",
  slope: number,
): { middle: number; depth: number; centered: number } {
  const upper = Math.max(...points.map((point) => point[axis] + slope * point.depth));
  const lower = Math.max(...points.map((point) => -point[axis] + slope * point.depth));
  return {
    middle: (upper - lower) / 2,
    depth: (upper + lower) / (2 * slope),
    centered: Math.max(upper, lower) / slope,
  };
}
