// Cuts through volume meshes.

import assert from "node:assert/strict";
import { test } from "node:test";

import { InvalidInputError, ReelFile } from "../dist/index.js";
import { ReelMesh } from "../dist/three.js";
import { PLAYED, expectedOf, streamBytes } from "./support/streams.mjs";

const VOLUMES = PLAYED.filter((name) => expectedOf(name).cells);
const BLOCK = "cells_listed";

async function withReel(name, work) {
  const reel = await ReelFile.open(streamBytes(name));
  try {
    await work(reel);
  } finally {
    reel.close();
  }
}

/** The middle of the first frame along x. */
function middle(positions) {
  const along = positions.filter((_, i) => i % 3 === 0);
  return (Math.min(...along) + Math.max(...along)) / 2;
}

test("a cut beyond all cells returns the surface of the file", async () => {
  assert.ok(VOLUMES.length > 5);
  for (const name of VOLUMES) {
    await withReel(name, async (reel) => {
      const { triangles, faceSizes, triangleCorners, cells } = await reel.cut({ normal: [1, 0, 0], offset: 1e30 });
      const { surface } = reel;
      assert.deepEqual(triangles, surface.triangles, name);
      assert.deepEqual(faceSizes, surface.faceSizes ?? new Uint32Array(triangles.length / 3).fill(3), name);
      assert.deepEqual(triangleCorners, surface.triangleCorners ?? Uint32Array.from(triangles.keys()), name);
      assert.deepEqual(cells, surface.cells, name);
    });
  }
});

test("a cut leaves out the cells beyond the plane, and closes the rest", async () => {
  await withReel(BLOCK, async (reel) => {
    const positions = await reel.frame(0);
    for (const sign of [1, -1]) {
      const offset = sign * middle(positions);
      const { triangles, cells } = await reel.cut({ normal: [sign, 0, 0], offset });
      const { nodes } = cells; // hexahedra
      const center = (cell) => nodes.slice(8 * cell, 8 * cell + 8).reduce((sum, node) => sum + positions[3 * node], 0) / 8;
      const kept = [...new Set(cells.faceCells)];
      assert.ok(kept.every((cell) => sign * center(cell) <= offset));
      assert.ok(kept.length < cells.types.length);
      const edges = new Map();
      for (let i = 0; i < triangles.length; i++) {
        const [a, b] = [triangles[i], triangles[i % 3 === 2 ? i - 2 : i + 1]];
        edges.set(`${a} ${b}`, (edges.get(`${a} ${b}`) ?? 0) + 1);
      }
      for (const [edge, count] of edges) assert.equal(count, edges.get(edge.split(" ").reverse().join(" ")), edge);
    }
  });
});

test("a cut needs cells, and some that are not beyond the plane", async () => {
  await withReel(BLOCK, async (reel) => {
    const cut = reel.cut({ normal: [0, 0, 1], offset: -1e30 });
    await assert.rejects(cut, new InvalidInputError("all cells are beyond the plane"));
  });
  await withReel("lossless_still", async (reel) => {
    await assert.rejects(reel.cut({ normal: [0, 0, 1], offset: 0 }), /only volume meshes can be cut/);
  });
});

test("a mesh plays the cells that a cut leaves", async () => {
  const reel = await ReelFile.open(streamBytes(BLOCK));
  const mesh = new ReelMesh(reel, { gpu: false, ownsReel: true });
  const shown = () => new Promise((resolve) => mesh.addEventListener("frame", resolve));
  try {
    const whole = mesh.geometry.index.count;
    const plane = { normal: [1, 0, 0], offset: middle(await reel.frame(0)) };
    const outdated = mesh.cut({ ...plane, offset: 0 });
    await Promise.all([mesh.cut(plane), assert.rejects(outdated, { name: "AbortError" })]);
    mesh.seek({ frame: 1 });
    await shown();
    assert.deepEqual(mesh.surface, await reel.cut(plane));
    assert.notEqual(mesh.geometry.index.count, whole);
    const [positions, expected] = [mesh.geometry.getAttribute("position").array, await reel.frame(1)];
    for (const i of mesh.geometry.index.array) {
      assert.ok(Math.abs(positions[3 * i] - expected[3 * mesh.sources[i]]) < 1e-5 * reel.info.diagonal);
    }
    await mesh.cut(null);
    await shown();
    assert.equal(mesh.surface, reel.surface);
    assert.equal(mesh.geometry.index.count, whole);
  } finally {
    mesh.dispose();
  }
});

test("cells are drawn flat, and other meshes smooth, by default", async () => {
  const other = PLAYED.find((name) => !expectedOf(name).cells);
  for (const [name, options, isFlat] of [[BLOCK, {}, true], [BLOCK, { flat: false }, false], [other, {}, false]]) {
    const mesh = new ReelMesh(await ReelFile.open(streamBytes(name)), { gpu: false, ownsReel: true, ...options });
    for (const { flatShading } of [mesh.material].flat()) assert.equal(flatShading, isFlat, name);
    mesh.dispose();
  }
});
