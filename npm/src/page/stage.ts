// The canvas: one camera, shared by one or two views side by side.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

import { framePoints, createCamera, setAspect, setDepthRange } from "./camera.js";
import type { Reel } from "./facts.js";

export type Background = "light" | "dark" | "none";

const CLEAR: Record<Background, [number, number]> = {
  light: [0xf4f5f7, 1],
  dark: [0x15181d, 1],
  none: [0x000000, 0],
};

/** Renderer, camera, lights and views. */
export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  /** Called when a redraw is needed. */
  onChange: () => void = () => {};
  private readonly camera = createCamera();
  private readonly controls: OrbitControls;
  /** Rotated by the up axis; its child `model` is translated to follow the mesh. */
  private readonly world = new THREE.Group();
  private readonly model = new THREE.Group();
  private readonly scene = new THREE.Scene();
  private readonly box: THREE.Box3;
  private readonly sweptPoints: THREE.Vector3[];
  private framedPoints: THREE.Vector3[];
  private views: THREE.Object3D[][] = [];
  private background: Background = "light";
  /** Whether the user has moved the camera. */
  private isUserControlled = false;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    reel: Reel,
  ) {
    const { center, diagonal } = reel.file.info;
    this.renderer = createRenderer(canvas);
    const origin = new THREE.Vector3(...center);
    this.box = new THREE.Box3(
      new THREE.Vector3(...reel.low).sub(origin),
      new THREE.Vector3(...reel.high).sub(origin),
    );
    this.sweptPoints = reel.swept.map((point) => new THREE.Vector3(...point));
    this.framedPoints = this.sweptPoints;
    this.scene.add(this.world, this.camera, new THREE.HemisphereLight(0xffffff, 0x667788, 1.2));
    this.camera.add(...createLights());
    this.world.add(this.model);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.controls.minDistance = diagonal * 0.01;
    this.controls.maxDistance = diagonal * 50 || 50;
    this.controls.addEventListener("change", () => this.onChange());
    this.controls.addEventListener("start", () => (this.isUserControlled = true));
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement as HTMLElement);
  }

  add(object: THREE.Object3D): void {
    this.model.add(object);
  }

  /** Set the objects of each view. */
  setViews(views: THREE.Object3D[][]): void {
    this.views = views;
    this.resize();
  }

  /** Whether views are stacked vertically, as on a phone in portrait orientation. */
  get isPortrait(): boolean {
    return this.canvas.clientWidth < this.canvas.clientHeight;
  }

  setUp(axis: "y" | "z"): void {
    this.world.rotation.x = axis === "z" ? -Math.PI / 2 : 0;
    this.world.updateMatrixWorld();
    this.reset();
  }

  /** Translate the model so that this point is at the center of the box; null: no translation. */
  follow(point: THREE.Vector3 | null): void {
    const middle = this.box.getCenter(this.model.position);
    if (point) middle.sub(point);
    else middle.set(0, 0, 0);
  }

  /** Frame points around the center of the box; null: the whole animation. */
  frame(points: THREE.Vector3[] | null): void {
    this.framedPoints = this.centered(points);
    this.reset();
  }

  /** Distance of the camera if it framed these points. */
  distanceTo(points: THREE.Vector3[] | null): number {
    const camera = this.camera.clone();
    return framePoints(camera, this.toWorld(this.centered(points))).distanceTo(camera.position);
  }

  /** Return the ray through a position on the page; null outside of the canvas. */
  rayAt(clientX: number, clientY: number): THREE.Raycaster | null {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const n = Math.max(1, this.views.length);
    const [w, h] = this.isPortrait ? [width, height / n] : [width / n, height];
    const [x, y] = [clientX - left, clientY - top];
    if (!(x >= 0 && x < width && y >= 0 && y < height)) return null;
    const ray = new THREE.Raycaster();
    const place = new THREE.Vector2((2 * (x % w)) / w - 1, 1 - (2 * (y % h)) / h);
    ray.setFromCamera(place, this.camera);
    return ray;
  }

  setBackground(background: Background): void {
    this.background = background;
    this.onChange();
  }

  /** Return the camera to the view that frames the current points. */
  reset(): void {
    this.isUserControlled = false;
    this.controls.target.copy(framePoints(this.camera, this.toWorld(this.framedPoints)));
    this.controls.update();
    this.onChange();
  }

  draw(): void {
    const box = this.box.clone().applyMatrix4(this.world.matrixWorld);
    setDepthRange(this.camera, box);
    const { width, height } = this.renderer.getSize(new THREE.Vector2());
    const n = Math.max(1, this.views.length);
    const [w, h] = this.isPortrait ? [width, height / n] : [width / n, height];
    this.renderer.setScissorTest(true);
    this.views.forEach((shown, i) => {
      const rectangle = this.isPortrait ? [0, height - (i + 1) * h, w, h] : [i * w, 0, w, h];
      this.renderer.setViewport(...(rectangle as [number, number, number, number]));
      this.renderer.setScissor(...(rectangle as [number, number, number, number]));
      this.model.children.forEach((object) => (object.visible = shown.includes(object)));
      // Set each time, since passes change the clear color.
      this.renderer.setClearColor(...CLEAR[this.background]);
      this.renderer.clear();
      this.renderer.render(this.scene, this.camera);
    });
  }

  private centered(points: THREE.Vector3[] | null): THREE.Vector3[] {
    const middle = this.box.getCenter(new THREE.Vector3());
    return points?.map((point) => point.clone().add(middle)) ?? this.sweptPoints;
  }

  private toWorld(points: THREE.Vector3[]): THREE.Vector3[] {
    return points.map((point) => point.clone().applyMatrix4(this.world.matrixWorld));
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas.parentElement as HTMLElement;
    const [width, height] = [Math.max(1, clientWidth), Math.max(1, clientHeight)];
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    const n = Math.max(1, this.views.length);
    setAspect(this.camera, this.isPortrait ? (width * n) / height : width / n / height);
    if (!this.isUserControlled) this.reset();
    this.onChange();
  }
}

function createRenderer(canvas: HTMLCanvasElement): THREE.WebGLRenderer {
  const context = canvas.getContext("webgl2", { antialias: !usesSoftwareRendering(), alpha: true });
  if (!context) {
    throw new Error(
      "This browser does not support WebGL 2, which the player needs. " +
        "Turn on hardware acceleration, or try another browser.",
    );
  }
  if (!context.getExtension("EXT_color_buffer_float")) {
    throw new Error("This graphics card cannot render to float textures, which the player needs.");
  }
  const renderer = new THREE.WebGLRenderer({ canvas, context });
  renderer.autoClear = false;
  return renderer;
}

/** Lights for materials of the file, attached to the camera, in the directions of the default shading. */
function createLights(): THREE.Object3D[] {
  const key = new THREE.DirectionalLight(0xffffff, 2);
  const fill = new THREE.DirectionalLight(0xffffff, 0.5);
  key.position.set(-0.45, 0.65, 0.62);
  fill.position.set(0.7, 0.1, 0.7);
  return [key, key.target, fill, fill.target];
}

/** Whether WebGL is rendered in software, where antialiasing would halve the frame rate. */
function usesSoftwareRendering(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const renderer = names ? String(context?.getParameter(names.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}
