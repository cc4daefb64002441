// Vertices of a three.js mesh that are split at seams.

import assert from "node:assert/strict";
import { test } from "node:test";

import { ReelFile } from "../dist/index.js";
import { ReelLoader, ReelMesh } from "../dist/three.js";
import { streamBytes } from "./support/streams.mjs";

/** Return what a mesh draws: the vertices of the file, and the names of its attributes. */
function drawn({ reel, sources, geometry }) {
  const triangles = [...geometry.index.array].map((vertex) => sources[vertex]);
  assert.deepEqual(triangles, [...reel.surface.triangles]);
  return { nVerts: sources.length, names: Object.keys(geometry.attributes).sort() };
}

function firstFrame(mesh) {
  return new Promise((resolve, reject) => {
    mesh.addEventListener("frame", resolve);
    mesh.addEventListener("error", ({ error }) => reject(error));
  });
}

test("a mesh has split vertices with their attributes when it is created", async () => {
  const reel = await ReelFile.open(streamBytes("attributes_on_surface"));
  const mesh = new ReelMesh(reel, { gpu: false, ownsReel: true });
  const { nVerts, names } = drawn(mesh);
  assert.ok(nVerts > reel.info.nVerts);
  assert.deepEqual(names, ["normal", "position", "uv"]);
  await firstFrame(mesh);
  assert.equal(drawn(mesh).nVerts, nVerts);
  const positions = await mesh.positionsAt(0);
  const { array } = mesh.geometry.getAttribute("position");
  mesh.sources.forEach((source, i) => {
    for (let axis = 0; axis < 3; axis++) {
      assert.ok(Math.abs(array[3 * i + axis] - positions[3 * source + axis]) < 1e-5 * reel.info.diagonal);
    }
  });
  mesh.dispose();
});

test("a loader returns complete meshes", async () => {
  const loader = new ReelLoader(undefined, { gpu: false });
  for (const [name, names] of [
    ["hard_edges", ["normal", "position"]],
    ["attributes_on_surface", ["normal", "position", "uv"]],
  ]) {
    const mesh = await loader.parse(streamBytes(name).buffer);
    const { geometry } = mesh;
    const before = drawn(mesh);
    assert.ok(before.nVerts > mesh.reel.info.nVerts);
    assert.deepEqual(before.names, names);
    await firstFrame(mesh);
    assert.equal(mesh.geometry, geometry);
    mesh.dispose();
  }
});
