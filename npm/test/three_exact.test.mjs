// A mesh of three.js plays files without modes: positions are those of the file, and it has none
// to leave out.

import assert from "node:assert/strict";
import { test } from "node:test";

import { InvalidInputError, ReelFile } from "../dist/index.js";
import { ReelMesh } from "../dist/three.js";
import { bytesOf } from "./support/streams.mjs";

/** Runs `work` with a mesh of a stream, computed on the CPU, whose first picture is there. */
async function withMesh(name, work) {
  const reel = await ReelFile.open(bytesOf(name));
  const mesh = new ReelMesh(reel, { gpu: false, ownsReel: true });
  try {
    await shown(mesh, 0);
    await work(mesh);
  } finally {
    mesh.dispose();
  }
}

/** Goes to a frame, whose picture is there then. */
async function shown(mesh, frame) {
  const drawn = new Promise((resolve, reject) => {
    mesh.addEventListener("frame", (event) => event.frame === frame && resolve());
    mesh.addEventListener("error", ({ error }) => reject(error));
  });
  mesh.seek({ frame });
  await drawn;
}

for (const name of ["lossless_still", "lossless_in_blocks", "grid_doubles", "grid_with_tracks"]) {
  test(`frames of ${name} are shown where they are`, async () => {
    await withMesh(name, async (mesh) => {
      const { nFrames, diagonal } = mesh.reel.info;
      for (const frame of [nFrames - 1, ...Array(nFrames - 1).keys()]) {
        await shown(mesh, frame);
        const wanted = await mesh.positionsAt(frame);
        const found = mesh.geometry.getAttribute("position").array;
        mesh.sources.forEach((vertex, i) => {
          for (let axis = 0; axis < 3; axis++) {
            const value = wanted[3 * vertex + axis];
            const off = Math.abs(found[3 * i + axis] - value) - 2 ** -22 * Math.abs(value);
            assert.ok(off < 1e-5 * diagonal, `${name}, frame ${frame}: ${off}`);
          }
        });
      }
    });
  });
}

test("a file is played from block to block, and between frames", async () => {
  await withMesh("grid_doubles", async (mesh) => {
    const frames = new Set();
    mesh.addEventListener("frame", ({ frame }) => frames.add(frame));
    mesh.loop = "once";
    mesh.play();
    for (let turn = 0; turn < 2000 && mesh.isPlaying; turn++) {
      mesh.update(0.02);
      await new Promise((resolve) => setImmediate(resolve));
    }
    assert.ok(!mesh.isPlaying && frames.has(mesh.nFrames - 1));
    assert.ok(frames.size >= mesh.nFrames - 1);
  });
});

test("modes are none, so that there is no number of them", async () => {
  await withMesh("lossless", async (mesh) => {
    assert.throws(
      () => (mesh.modes = 2),
      (error) =>
        error instanceof InvalidInputError &&
        error.message === "files of the method lossless have no modes; got 2",
    );
    mesh.modes = Infinity;
  });
});
