// <three-figure src="walk.glb">: plays a .glb or .reel file in three.js, and shows its size and times.
//
// Both kinds are drawn by the same renderer, so that their times can be compared in one browser.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { MeshoptDecoder } from "three/addons/libs/meshopt_decoder.module.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

import { ReelLoader } from "../src/three/index.js";

const BACKGROUND = 0xffffff;
const N_MEASURED = 20;

/** An object in the scene, the sphere that it fills, and what moves it to its pose after some seconds. */
interface Animated {
  object: THREE.Object3D;
  sphere: THREE.Sphere;
  advance: (seconds: number) => void;
  isReady: () => boolean;
}

async function openReel(data: ArrayBuffer): Promise<Animated> {
  const mesh = await new ReelLoader().parse(data);
  mesh.loop = true;
  mesh.play();
  const { center, diagonal } = mesh.reel.info;
  return {
    object: mesh,
    sphere: new THREE.Sphere(new THREE.Vector3(...center), diagonal / 2),
    advance: (seconds) => mesh.update(seconds),
    isReady: () => !mesh.isWaiting,
  };
}

async function openGltf(data: ArrayBuffer): Promise<Animated> {
  const { scene, animations } = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(data, "");
  const mixer = new THREE.AnimationMixer(scene);
  mixer.clipAction(animations[0]).play();
  return {
    object: scene,
    sphere: new THREE.Box3().setFromObject(scene, true).getBoundingSphere(new THREE.Sphere()),
    advance: (seconds) => mixer.update(seconds),
    isReady: () => true,
  };
}

class ThreeFigure extends HTMLElement {
  readonly #times: number[] = [];
  #openMs = 0;
  #size = 0;

  connectedCallback(): void {
    const seen = new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      seen.disconnect();
      this.#show().catch((error: unknown) => this.#say(String(error)));
    });
    seen.observe(this);
  }

  async #show(): Promise<void> {
    const src = this.getAttribute("src")!;
    const response = await fetch(src);
    if (!response.ok) throw new Error(`${src}: ${response.status} ${response.statusText}`);
    const data = await response.arrayBuffer();
    this.#size = data.byteLength;
    const canvas = document.createElement("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", this.getAttribute("alt") ?? src);
    this.append(canvas, document.createElement("p"));
    const renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    renderer.setPixelRatio(devicePixelRatio);
    renderer.setClearColor(BACKGROUND);

    const start = performance.now();
    const animated = await (src.endsWith(".reel") ? openReel(data) : openGltf(data));
    const camera = new THREE.PerspectiveCamera(40);
    const scene = new THREE.Scene();
    const light = new THREE.DirectionalLight(0xffffff, 2);
    camera.add(light.translateX(1).translateY(1));
    scene.add(animated.object, camera, new THREE.HemisphereLight(0xffffff, 0x888888, 1.5));
    const controls = new OrbitControls(camera, canvas);
    controls.enableZoom = false; // the wheel scrolls the page
    frame(camera, controls, animated.sphere);
    let last: number | undefined;
    let width = 0;
    renderer.setAnimationLoop((now: number) => {
      const before = performance.now();
      animated.advance(last === undefined ? 0 : (now - last) / 1000);
      last = now;
      if (this.clientWidth !== width) {
        width = this.clientWidth;
        renderer.setSize(width, width, false);
      }
      controls.update();
      renderer.render(scene, camera);
      if (!animated.isReady()) return;
      if (this.#openMs === 0) this.#openMs = performance.now() - start;
      else if (this.#times.length < N_MEASURED) this.#times.push(performance.now() - before);
      else return;
      this.#showTimes();
    });
  }

  #showTimes(): void {
    const sorted = this.#times.toSorted((a, b) => a - b);
    const perFrame = sorted.length < N_MEASURED ? "…" : sorted[N_MEASURED / 2].toFixed(1);
    const kilobytes = (this.#size / 1000).toFixed(0);
    this.#say(`${kilobytes} kB, first picture after ${this.#openMs.toFixed(0)} ms, then ${perFrame} ms per picture`);
  }

  #say(text: string): void {
    const paragraph = this.querySelector("p") ?? this.appendChild(document.createElement("p"));
    paragraph.textContent = text;
  }
}

/** Place the camera so that it sees a sphere. */
function frame(camera: THREE.PerspectiveCamera, controls: OrbitControls, sphere: THREE.Sphere): void {
  const distance = sphere.radius / Math.sin(THREE.MathUtils.degToRad(camera.fov / 2));
  camera.near = distance / 100;
  camera.far = distance * 10;
  camera.position.setFromSphericalCoords(distance, 1.3, -0.6).add(sphere.center);
  controls.target.copy(sphere.center);
  camera.updateProjectionMatrix();
}

customElements.define("three-figure", ThreeFigure);
