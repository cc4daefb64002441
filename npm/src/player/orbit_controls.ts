// Moves a camera around a point with mouse, wheel and touch.

import { type PerspectiveCamera, Raycaster, Vector3 } from "../webgl/index.js";

/** Angles from the vertical below which the direction to the right would be undefined. */
export const MIN_PHI = 1e-3;

/** Zoom factor of 100 pixels of a wheel or a drag. */
const ZOOM_FACTOR = 0.95;

/** Pixels per unit of a wheel, by its `deltaMode`: pixels, lines and pages. */
const WHEEL_UNITS = [1, 16, 100];

/** Factor of a pinch on a touchpad, whose deltas are small. */
const PINCH_FACTOR = 10;

type Action = "rotate" | "pan" | "zoom";

/** The position of pointers: their center, and the distance of two. */
interface PointerState {
  readonly x: number;
  readonly y: number;
  readonly size: number;
}

/** Where the camera is, relative to the point that it orbits. */
export interface CameraOrbit {
  /** Azimuth in radians. */
  readonly theta: number;
  /** Angle from the vertical in radians. */
  readonly phi: number;
  /** Distance in model units. */
  readonly radius: number;
}

/** Return where a point is relative to a target. */
export function sphericalAround(target: Vector3, { x, y, z }: Vector3): CameraOrbit {
  [x, y, z] = [x - target.x, y - target.y, z - target.z];
  const radius = Math.hypot(x, y, z);
  return { theta: Math.atan2(x, z), phi: Math.acos(Math.min(Math.max(y / (radius || 1), -1), 1)), radius };
}

/**
 * Rotates by the left button or one finger, pans by the right button (or left with Ctrl or Shift) or
 * two fingers, and zooms by the wheel, the middle button or two fingers.
 */
export class OrbitControls {
  minDistance = 0;
  maxDistance = Infinity;
  readonly #camera: PerspectiveCamera;
  readonly #canvas: HTMLCanvasElement;
  readonly #target: Vector3;
  readonly #onChange: () => void;
  readonly #onInput: () => void;
  readonly #listeners = new AbortController();
  readonly #pointers = new Map<number, { x: number; y: number }>();
  #action: Action = "rotate";
  #last: PointerState = { x: 0, y: 0, size: 0 };
  /** Where a zoom by dragging started. */
  #start = { x: 0, y: 0 };
  #isControlDown = false;

  /**
   * @param target - the point around which the camera moves; panning changes it
   * @param onChange - called when the camera has moved
   * @param onInput - called when input starts and ends
   */
  constructor(
    camera: PerspectiveCamera,
    canvas: HTMLCanvasElement,
    target: Vector3,
    onChange: () => void,
    onInput: () => void,
  ) {
    [this.#camera, this.#canvas, this.#target] = [camera, canvas, target];
    [this.#onChange, this.#onInput] = [onChange, onInput];
    const { signal } = this.#listeners;
    canvas.addEventListener("pointerdown", (event) => this.#press(event), { signal });
    canvas.addEventListener("pointermove", (event) => this.#move(event), { signal });
    for (const type of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(type, (event) => this.#release(event), { signal });
    }
    canvas.addEventListener("wheel", (event) => this.#scroll(event), { signal, passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault(), { signal });
    for (const type of ["keydown", "keyup"] as const) {
      const watch = ({ ctrlKey }: KeyboardEvent) => (this.#isControlDown = ctrlKey);
      document.addEventListener(type, watch, { signal, capture: true });
    }
  }

  /** Rotate by angles in radians, to the left and up. */
  rotate(left: number, up: number): void {
    const { theta, phi, radius } = sphericalAround(this.#target, this.#camera.position);
    const polar = Math.min(Math.max(phi - up, MIN_PHI), Math.PI - MIN_PHI);
    this.#camera.position.setFromSphericalCoords(radius, polar, theta - left).add(this.#target);
    this.#finish();
  }

  /** Multiply the distance by a factor, towards a position on the page; default: the target. */
  zoom(factor: number, towards?: { x: number; y: number }): void {
    const { position } = this.#camera;
    const distance = position.distanceTo(this.#target);
    const next = this.#limit(distance * factor);
    const ahead = this.#camera.axes[2].clone().negate();
    position.addScaledVector(towards ? this.#directionTo(towards) : ahead, distance - next);
    this.#target.copy(position).addScaledVector(ahead, next);
    this.#finish();
  }

  /** Keep the distance within its limits. */
  update(): void {
    const { position } = this.#camera;
    const distance = position.distanceTo(this.#target);
    const next = this.#limit(distance);
    if (next === distance) return;
    position.sub(this.#target).multiplyScalar(next / distance).add(this.#target);
    this.#finish();
  }

  dispose(): void {
    this.#listeners.abort();
  }

  #press(event: PointerEvent): void {
    this.#canvas.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const isOther = event.ctrlKey || event.metaKey || event.shiftKey;
    const action = (["rotate", "zoom", "pan"] as const)[event.button];
    if (!action) return;
    this.#action = action === "zoom" || !isOther ? action : action === "pan" ? "rotate" : "pan";
    this.#start = { x: event.clientX, y: event.clientY };
    this.#last = this.#state();
    this.#onInput();
  }

  #release(event: PointerEvent): void {
    if (!this.#pointers.delete(event.pointerId)) return;
    this.#last = this.#state();
    this.#onInput();
  }

  #move(event: PointerEvent): void {
    if (!this.#pointers.has(event.pointerId)) return;
    this.#pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const [last, next] = [this.#last, this.#state()];
    this.#last = next;
    const [dx, dy] = [next.x - last.x, next.y - last.y];
    const turn = (2 * Math.PI) / this.#canvas.clientHeight;
    if (this.#pointers.size === 2) {
      this.#pan(dx, dy);
      if (last.size && next.size) this.zoom(last.size / next.size, next);
    } else if (this.#pointers.size > 2) return;
    else if (this.#action === "rotate") this.rotate(turn * dx, turn * dy);
    else if (this.#action === "pan") this.#pan(dx, dy);
    else this.zoom(ZOOM_FACTOR ** (-dy / 100), this.#start);
  }

  #scroll(event: WheelEvent): void {
    if (this.#pointers.size) return;
    event.preventDefault();
    this.#onInput();
    const isPinch = event.ctrlKey && !this.#isControlDown;
    const delta = event.deltaY * WHEEL_UNITS[event.deltaMode] * (isPinch ? PINCH_FACTOR : 1);
    this.zoom(ZOOM_FACTOR ** (-delta / 100), { x: event.clientX, y: event.clientY });
  }

  /** Move by pixels. */
  #pan(dx: number, dy: number): void {
    const { axes, position, slope } = this.#camera;
    const scale = (2 * slope * position.distanceTo(this.#target)) / this.#canvas.clientHeight;
    const offset = new Vector3().addScaledVector(axes[0], -dx * scale).addScaledVector(axes[1], dy * scale);
    this.#target.add(offset);
    position.add(offset);
    this.#finish();
  }

  /** Direction of a position on the page. */
  #directionTo({ x, y }: { x: number; y: number }): Vector3 {
    const { left, top, width, height } = this.#canvas.getBoundingClientRect();
    const [across, along] = [(2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height];
    return Raycaster.fromCamera(across, along, this.#camera).direction.normalize();
  }

  #limit(distance: number): number {
    return Math.min(Math.max(distance, this.minDistance), this.maxDistance);
  }

  #state(): PointerState {
    const [a = { x: 0, y: 0 }, b = a] = [...this.#pointers.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, size: Math.hypot(a.x - b.x, a.y - b.y) };
  }

  #finish(): void {
    this.#camera.lookAt(this.#target);
    this.#camera.updateMatrixWorld();
    this.#onChange();
  }
}
