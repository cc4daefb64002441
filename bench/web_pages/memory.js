// The page of bench/web_memory.py, which calls the functions of `bench` and measures memory.

import * as THREE from "three";
import { ReelLoader } from "meshreel/three";

import { glBytes } from "./gl_memory.js";
import { animate, draw, lookAt, renderer, scene, still } from "./stage.js";

let mesh;
let nLoops = 0;
let nWaits = 0;

/** Bytes of the fields of the largest block. */
async function open(address) {
  // From memory, because DevTools retain network responses.
  const bytes = await (await fetch(address)).arrayBuffer();
  mesh = await new ReelLoader(undefined, { renderer }).parse(bytes);
  mesh.addEventListener("loop", () => nLoops++);
  mesh.addEventListener("waiting", () => nWaits++);
  const { center, diagonal, blocks } = mesh.reel.info;
  lookAt(center, 0.7 * diagonal);
  scene.add(mesh, new THREE.HemisphereLight(0xffffff, 0x667788, 3));
  let most = 0;
  for (let i = 0; i < blocks.length; i++) {
    most = Math.max(most, (await mesh.reel.fields(i)).fields.byteLength);
  }
  return most;
}

/** Plays several loops; returns milliseconds between pictures, and the number of stalls. */
async function loop(count, speed) {
  [mesh.speed, nLoops, nWaits] = [speed, 0, 0];
  mesh.play();
  const intervals = await animate((delta) => {
    mesh.update(delta);
    return nLoops < count;
  });
  return { intervals, nWaits };
}

/** Seeks to random frames, and waits for each picture. */
async function seek(count) {
  mesh.pause();
  const { nFrames } = mesh.reel.info;
  for (let i = 0; i < count; i++) {
    mesh.seek({ frame: Math.random() * (nFrames - 1) });
    await until(() => !mesh.isWaiting);
    draw();
  }
}

async function until(isSo) {
  while (!isSo()) await new Promise((resolve) => setTimeout(resolve));
}

window.bench = { open, loop, seek, still, glBytes };
