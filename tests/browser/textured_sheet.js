// Shows the sheet of tests/samples/numbered_video.py with a texture, and reads from each picture
// which frame of the mesh and which frame of the video it shows.

import * as THREE from "three";
import { ReelLoader } from "meshreel/three";

const [CELL, BITS, PIXELS, STEP] = [16, 12, 256, 4]; // of the video, and of the picture
const LEFT = 13; // of the sheet at frame 0

/** The canvas: 1 unit is 256 pixels, as in the video. */
class Screen {
  renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
  scene = new THREE.Scene();
  camera = new THREE.OrthographicCamera(0, 2.5, 1.125, -0.125, -1, 1);

  constructor() {
    this.renderer.setSize(640, 320);
    document.body.append(this.renderer.domElement);
    this.camera.position.x = -LEFT / PIXELS;
    this.scene.background = new THREE.Color(0x00ff00);
    this.scene.add(new THREE.AmbientLight(0xffffff, Math.PI));
  }

  /** Return the frames of mesh and video in the current picture. */
  read() {
    this.renderer.render(this.scene, this.camera);
    const gl = this.renderer.getContext();
    const row = new Uint8Array(4 * 640);
    gl.readPixels(0, 288 - CELL / 2, 640, 1, gl.RGBA, gl.UNSIGNED_BYTE, row);
    let left = 0;
    while (left < 640 && row[4 * left] < 64 && row[4 * left + 1] > 192) left++;
    return { mesh: (left - LEFT) / STEP, video: numberIn((x) => row[4 * (left + x)]) };
  }

  dispose() {
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}

/** Return these frames without WebGL, from the attributes and the texture image of the mesh. */
class Memory {
  constructor(mesh) {
    this.mesh = mesh;
    this.pen = new OffscreenCanvas(PIXELS, CELL).getContext("2d", { willReadFrequently: true });
  }

  read() {
    this.pen.drawImage(this.mesh.texture.image, 0, 0);
    const { data } = this.pen.getImageData(0, CELL / 2, PIXELS, 1);
    const left = PIXELS * this.mesh.geometry.getAttribute("position").array[0];
    return { mesh: left / STEP, video: numberIn((x) => data[4 * x]) };
  }

  dispose() {}
}

/** Return the number in a row of cells; null if the parity cell is wrong. */
function numberIn(brightnessAt) {
  const cells = Array.from({ length: BITS + 1 }, (_, i) =>
    Number(brightnessAt(CELL * i + CELL / 2) > 127),
  );
  const isOdd = cells.reduce((sum, one) => sum + one) % 2 === 1;
  return isOdd ? parseInt(cells.slice(0, BITS).join(""), 2) : null;
}

/** A repeatedly drawn mesh; records its shown frames and events. */
class Stand {
  events = [];
  seen = [];

  constructor(mesh, screen) {
    Object.assign(this, { mesh, screen });
    for (const type of ["loop", "ended", "waiting", "playing", "error", "warning"]) {
      mesh.addEventListener(type, ({ target: _, error, ...rest }) => {
        this.events.push(error ? { ...rest, error: `${error.name}: ${error.message}` } : rest);
      });
    }
    let last = performance.now();
    const draw = (now) => {
      if (this.isOver) return;
      requestAnimationFrame(draw);
      mesh.update(Math.max(now - last, 0) / 1000);
      last = now;
      const { drawRange } = mesh.geometry;
      if (drawRange.count && mesh.texture?.image?.width === PIXELS) this.seen.push(screen.read());
    };
    requestAnimationFrame(draw);
  }

  /** Wait until a condition holds. */
  async until(what, holds, seconds = 60) {
    const end = performance.now() + 1000 * seconds;
    while (!holds()) {
      if (performance.now() > end) {
        const { mesh, events, seen } = this;
        const { video, frame, isWaiting, isPlaying } = mesh;
        const state = { frame, isWaiting, isPlaying, time: video?.currentTime, events };
        throw new Error(`waited for ${what}: ${JSON.stringify({ ...state, n: seen.length })}`);
      }
      await new Promise((resolve) => setTimeout(resolve, 5));
    }
  }

  /** Wait until the mesh no longer waits, and return the drawn picture. */
  async shown() {
    await this.until("a picture", () => !this.mesh.isWaiting);
    const n = this.seen.length;
    await this.until("drawing", () => this.seen.length > n);
    return this.seen.at(-1);
  }

  /** Return the pictures in which mesh and video show different frames. */
  get wrong() {
    return this.seen.filter(({ mesh, video }) => Math.abs(mesh - video) > 0.2 || video === null);
  }

  dispose() {
    this.isOver = true;
    this.mesh.dispose();
    this.screen.dispose();
  }
}

/** A test scene of a file and a texture. */
window.made = async ({ reel = "/sheet.reel", texture, options, isDrawn = true, ...mesh }) => {
  const screen = isDrawn ? new Screen() : null;
  const given = isDrawn ? { renderer: screen.renderer } : { gpu: false };
  const loaded = await new ReelLoader(undefined, given).loadAsync(reel);
  Object.assign(loaded, { interpolate: false, ...mesh });
  screen?.scene.add(loaded);
  const stand = new Stand(loaded, screen ?? new Memory(loaded));
  if (texture !== undefined) await loaded.setTexture(texture, options);
  return stand;
};
