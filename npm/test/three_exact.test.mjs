// A three.js mesh plays files with exact positions, which have no modes.

import assert from "node:assert/strict";
import { test } from "node:test";

import { InvalidInputError, ReelFile } from "../dist/index.js";
import { ReelMesh } from "../dist/three.js";
import { streamBytes } from "./support/streams.mjs";

/** Call `work` with a mesh of a stream, computed on the CPU, that shows its first frame. */
async function withMesh(name, work) {
  const reel = await ReelFile.open(streamBytes(name));
  const mesh = new ReelMesh(reel, { gpu: false, ownsReel: true });
  try {
    await showFrame(mesh, 0);
    await work(mesh);
  } finally {
    mesh.dispose();
  }
}

/** Seek to a frame and wait until it is shown. */
async function showFrame(mesh, frame) {
  const isShown = new Promise((resolve, reject) => {
    mesh.addEventListener("frame", (event) => event.frame === frame && resolve());
    mesh.addEventListener("error", ({ error }) => reject(error));
  });
  mesh.seek({ frame });
  await isShown;
}

for (const name of ["lossless_still", "lossless_in_blocks", "grid_doubles", "grid_with_tracks"]) {
  test(`positions of ${name} are right`, async () => {
    await withMesh(name, async (mesh) => {
      const { nFrames, diagonal } = mesh.reel.info;
      for (const frame of [nFrames - 1, ...Array(nFrames - 1).keys()]) {
        await showFrame(mesh, frame);
        const expected = await mesh.positionsAt(frame);
        const positions = mesh.geometry.getAttribute("position").array;
        mesh.sources.forEach((vertex, i) => {
          for (let axis = 0; axis < 3; axis++) {
            const value = expected[3 * vertex + axis];
            const error = Math.abs(positions[3 * i + axis] - value) - 2 ** -22 * Math.abs(value);
            assert.ok(error < 1e-5 * diagonal, `${name}, frame ${frame}: ${error}`);
          }
        });
      }
    });
  });
}

test("a file with several blocks is played with interpolation", async () => {
  await withMesh("grid_doubles", async (mesh) => {
    const frames = new Set();
    mesh.addEventListener("frame", ({ frame }) => frames.add(frame));
    mesh.loop = false;
    mesh.play();
    for (let turn = 0; turn < 2000 && mesh.isPlaying; turn++) {
      mesh.update(0.02);
      await new Promise((resolve) => setImmediate(resolve));
    }
    assert.ok(!mesh.isPlaying && frames.has(mesh.nFrames - 1));
    assert.ok(frames.size >= mesh.nFrames - 1);
  });
});

test("the loop has the values of the element's attribute", async () => {
  await withMesh("grid_doubles", async (mesh) => {
    assert.equal(mesh.loop, true);
    for (const loop of [false, "pingpong", true]) assert.equal((mesh.loop = loop, mesh.loop), loop);
    for (const loop of ["once", "repeat", "", null, 1]) {
      assert.throws(() => (mesh.loop = loop), { name: "InvalidInputError", message: /true, false or "pingpong"/ });
    }
    assert.equal(mesh.loop, true);
  });
});

test("a clone plays independently, and the last mesh closes the file", async () => {
  await withMesh("grid_doubles", async (mesh) => {
    mesh.position.set(1, 2, 3);
    Object.assign(mesh, { loop: false, speed: 2 });
    await showFrame(mesh, 2);
    const clone = mesh.clone();
    assert.ok(clone instanceof ReelMesh && clone !== mesh && clone.geometry !== mesh.geometry);
    assert.deepEqual(clone.position.toArray(), [1, 2, 3]);
    assert.deepEqual([clone.loop, clone.speed], [false, 2]);
    assert.deepEqual([clone.frame, clone.isPlaying], [2, false]);
    await showFrame(clone, 3);
    assert.deepEqual([mesh.frame, clone.frame], [2, 3]);
    mesh.dispose();
    await showFrame(clone, 1); // the file is still open
    clone.dispose();
    await assert.rejects(clone.positionsAt(0), { name: "AbortError" });
  });
});
