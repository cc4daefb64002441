// The canvas: one camera, shared by one or two views side by side.

import * as THREE from "three";

import { PlayerCamera } from "../player/camera.js";
import type { Reel } from "./facts.js";

export type Background = "light" | "dark" | "none";

const CLEAR: Record<Background, [number, number]> = {
  light: [0xf4f5f7, 1],
  dark: [0x15181d, 1],
  none: [0x000000, 0],
};

/** The initial view, as of `meshreel render`: slightly from the side and above. */
const POSE = {
  ...{ theta: THREE.MathUtils.degToRad(30), phi: THREE.MathUtils.degToRad(78) },
  ...{ distance: null, zoom: 1, target: null, fieldOfView: 30 },
};

/** Radius of the depth range, relative to that of the box of all frames. */
const DEPTH_RATIO = 1.5;

/** Renderer, camera, lights and views. */
export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  /** Called when a redraw is needed. */
  onChange: () => void = () => {};
  private readonly camera: PlayerCamera;
  /** Rotated by the up axis; its child `model` is translated to follow the mesh. */
  private readonly world = new THREE.Group();
  private readonly model = new THREE.Group();
  private readonly scene = new THREE.Scene();
  private readonly box: THREE.Box3;
  private readonly sweptPoints: THREE.Vector3[];
  private framedPoints: THREE.Vector3[];
  private views: THREE.Object3D[][] = [];
  private background: Background = "light";

  constructor(
    private readonly canvas: HTMLCanvasElement,
    reel: Reel,
  ) {
    const { center } = reel.file.info;
    this.renderer = createRenderer(canvas);
    const origin = new THREE.Vector3(...center);
    this.box = new THREE.Box3(
      new THREE.Vector3(...reel.low).sub(origin),
      new THREE.Vector3(...reel.high).sub(origin),
    );
    this.sweptPoints = reel.swept.map((point) => new THREE.Vector3(...point));
    this.framedPoints = this.sweptPoints;
    this.camera = new PlayerCamera(canvas, () => this.onChange(), "always");
    const { camera } = this.camera;
    this.scene.add(this.world, camera, new THREE.HemisphereLight(0xffffff, 0x667788, 1.2));
    camera.add(...createLights());
    this.world.add(this.model);
    this.camera.frame(this.sweptPoints, POSE);
    this.camera.hasControls = true;
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
    return this.camera.distanceTo(this.toWorld(this.centered(points)));
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
    ray.setFromCamera(place, this.camera.camera);
    return ray;
  }

  setBackground(background: Background): void {
    this.background = background;
    this.onChange();
  }

  /** Return the camera to the view that frames the current points. */
  reset(): void {
    this.camera.frame(this.toWorld(this.framedPoints));
  }

  draw(): void {
    const box = this.box.clone().applyMatrix4(this.world.matrixWorld);
    const { center, radius } = box.getBoundingSphere(new THREE.Sphere());
    this.camera.setDepthRange(center, DEPTH_RATIO * (radius || 1));
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
      this.renderer.render(this.scene, this.camera.camera);
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
    this.camera.setAspect(this.isPortrait ? (width * n) / height : width / n / height);
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
