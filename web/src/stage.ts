// The canvas: one camera, and one or two views side by side that share it.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

import { framePoints, makeCamera, setAspect, setDepthRange } from "./camera";
import type { Reel } from "./facts";

export type Background = "light" | "dark" | "none";

const CLEAR: Record<Background, [number, number]> = {
  light: [0xf4f5f7, 1],
  dark: [0x15181d, 1],
  none: [0x000000, 0],
};

export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  /** Called when the picture must be drawn again. */
  changed: () => void = () => {};
  private readonly camera = makeCamera();
  private readonly controls: OrbitControls;
  /** Turned by the up axis; its contents are moved where the mesh is followed. */
  private readonly world = new THREE.Group();
  private readonly model = new THREE.Group();
  private readonly scene = new THREE.Scene();
  private readonly box: THREE.Box3;
  private readonly swept: THREE.Vector3[];
  private framed: THREE.Vector3[];
  private views: THREE.Object3D[][] = [];
  private background: Background = "light";
  /** Whether somebody has turned or moved the view. */
  private isMoved = false;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    reel: Reel,
  ) {
    const { center, diagonal } = reel.file.info;
    this.renderer = makeRenderer(canvas);
    const origin = new THREE.Vector3(...center);
    this.box = new THREE.Box3(
      new THREE.Vector3(...reel.low).sub(origin),
      new THREE.Vector3(...reel.high).sub(origin),
    );
    this.swept = reel.swept.map((point) => new THREE.Vector3(...point));
    this.framed = this.swept;
    this.scene.add(this.world, this.camera, new THREE.HemisphereLight(0xffffff, 0x667788, 1.2));
    this.camera.add(...lights());
    this.world.add(this.model);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.controls.minDistance = diagonal * 0.01;
    this.controls.maxDistance = diagonal * 50 || 50;
    this.controls.addEventListener("change", () => this.changed());
    this.controls.addEventListener("start", () => (this.isMoved = true));
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement as HTMLElement);
  }

  add(object: THREE.Object3D): void {
    this.model.add(object);
  }

  /** Shows these objects; one view for each list, beside or below each other. */
  setViews(views: THREE.Object3D[][]): void {
    this.views = views;
    this.resize();
  }

  /** Whether views lie below each other, as on a phone that is held upright. */
  get isUpright(): boolean {
    return this.canvas.clientWidth < this.canvas.clientHeight;
  }

  setUp(axis: "y" | "z"): void {
    this.world.rotation.x = axis === "z" ? -Math.PI / 2 : 0;
    this.world.updateMatrixWorld();
    this.reset();
  }

  /** Moves this point of the model to the middle of the box; null: all stays where it is. */
  follow(point: THREE.Vector3 | null): void {
    const middle = this.box.getCenter(this.model.position);
    if (point) middle.sub(point);
    else middle.set(0, 0, 0);
  }

  /** Looks at points about the middle, where a mesh is kept; null: at all that the mesh sweeps. */
  frame(points: THREE.Vector3[] | null): void {
    this.framed = this.inTheMiddle(points);
    this.reset();
  }

  /** How far the camera would be from these points, as `frame` takes them. */
  distanceTo(points: THREE.Vector3[] | null): number {
    const camera = this.camera.clone();
    return framePoints(camera, this.turned(this.inTheMiddle(points))).distanceTo(camera.position);
  }

  /** The ray into the model at a place of the page; null beside the canvas. */
  rayAt(clientX: number, clientY: number): THREE.Raycaster | null {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const n = Math.max(1, this.views.length);
    const [w, h] = this.isUpright ? [width, height / n] : [width / n, height];
    const [x, y] = [clientX - left, clientY - top];
    if (!(x >= 0 && x < width && y >= 0 && y < height)) return null;
    const ray = new THREE.Raycaster();
    const place = new THREE.Vector2((2 * (x % w)) / w - 1, 1 - (2 * (y % h)) / h);
    ray.setFromCamera(place, this.camera);
    return ray;
  }

  setBackground(background: Background): void {
    this.background = background;
    this.changed();
  }

  /** Puts the camera back to where it sees everything that it frames. */
  reset(): void {
    this.isMoved = false;
    this.controls.target.copy(framePoints(this.camera, this.turned(this.framed)));
    this.controls.update();
    this.changed();
  }

  draw(): void {
    const box = this.box.clone().applyMatrix4(this.world.matrixWorld);
    setDepthRange(this.camera, box);
    const { width, height } = this.renderer.getSize(new THREE.Vector2());
    const n = Math.max(1, this.views.length);
    const [w, h] = this.isUpright ? [width, height / n] : [width / n, height];
    this.renderer.setScissorTest(true);
    this.views.forEach((shown, i) => {
      const rectangle = this.isUpright ? [0, height - (i + 1) * h, w, h] : [i * w, 0, w, h];
      this.renderer.setViewport(...(rectangle as [number, number, number, number]));
      this.renderer.setScissor(...(rectangle as [number, number, number, number]));
      this.model.children.forEach((object) => (object.visible = shown.includes(object)));
      // Each time: passes over textures have it in their own colour space.
      this.renderer.setClearColor(...CLEAR[this.background]);
      this.renderer.clear();
      this.renderer.render(this.scene, this.camera);
    });
  }

  private inTheMiddle(points: THREE.Vector3[] | null): THREE.Vector3[] {
    const middle = this.box.getCenter(new THREE.Vector3());
    return points?.map((point) => point.clone().add(middle)) ?? this.swept;
  }

  private turned(points: THREE.Vector3[]): THREE.Vector3[] {
    return points.map((point) => point.clone().applyMatrix4(this.world.matrixWorld));
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas.parentElement as HTMLElement;
    const [width, height] = [Math.max(1, clientWidth), Math.max(1, clientHeight)];
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    const n = Math.max(1, this.views.length);
    setAspect(this.camera, this.isUpright ? (width * n) / height : width / n / height);
    if (!this.isMoved) this.reset();
    this.changed();
  }
}

function makeRenderer(canvas: HTMLCanvasElement): THREE.WebGLRenderer {
  const context = canvas.getContext("webgl2", { antialias: !isDrawnInSoftware(), alpha: true });
  if (!context) {
    throw new Error(
      "This browser gives the page no WebGL 2, which the player draws with. " +
        "Turn on hardware acceleration, or try another browser.",
    );
  }
  if (!context.getExtension("EXT_color_buffer_float")) {
    throw new Error("This graphics card cannot compute floats into textures, as the player must.");
  }
  const renderer = new THREE.WebGLRenderer({ canvas, context });
  renderer.autoClear = false;
  return renderer;
}

/** For materials of files, from where the player's own light comes; they go with the camera. */
function lights(): THREE.Object3D[] {
  const key = new THREE.DirectionalLight(0xffffff, 2);
  const fill = new THREE.DirectionalLight(0xffffff, 0.5);
  key.position.set(-0.45, 0.65, 0.62);
  fill.position.set(0.7, 0.1, 0.7);
  return [key, key.target, fill, fill.target];
}

/** Whether no graphics card draws; smooth edges would then halve the frame rate. */
function isDrawnInSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const renderer = names ? String(context?.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}
