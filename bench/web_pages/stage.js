// Scene, camera and renderer of the measured pages.

import * as THREE from "three";

export const renderer = new THREE.WebGLRenderer();
renderer.setSize(innerWidth, innerHeight);
document.body.replaceChildren(renderer.domElement);
export const scene = new THREE.Scene();
scene.background = new THREE.Color(0x305070);
const camera = new THREE.PerspectiveCamera(40, innerWidth / innerHeight);

/** Frames a sphere around a point. */
export function lookAt(center, size) {
  camera.position.set(center[0], center[1], center[2] + 1.5 * size);
  camera.near = size / 100;
  camera.far = 10 * size;
  camera.updateProjectionMatrix();
}

/** Draws, and optionally waits for the pixels. */
export function draw(isFinished = false) {
  renderer.render(scene, camera);
  if (!isFinished) return;
  const gl = renderer.getContext();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}

/**
 * Calls a function for each picture with the seconds since the last one, and draws, until it
 * returns false; returns the milliseconds between pictures.
 */
export function animate(step) {
  const intervals = [];
  let last = 0;
  return new Promise((resolve) => {
    const next = (now) => {
      if (last) intervals.push(now - last);
      const goesOn = step(last ? (now - last) / 1000 : 0);
      last = now;
      draw();
      if (goesOn) requestAnimationFrame(next);
      else resolve(intervals);
    };
    requestAnimationFrame(next);
  });
}

/** Draws a static picture for some seconds; returns the milliseconds between pictures. */
export function still(seconds) {
  let passed = 0;
  return animate((delta) => (passed += delta) < seconds);
}
