// Blocks as small integers make the frames that the decoder makes, nearly.

import assert from "node:assert/strict";
import { test } from "node:test";
import { engineOf, loadInternals } from "./support/bundle.mjs";
import { groupsOf } from "./support/container.mjs";
import { EXACTS, REELS, bytesOf } from "./support/streams.mjs";

const internals = await loadInternals();
const { signal } = new AbortController();
const AXES = [0, 1, 2];

/** How far integers may move a vertex, in diagonals. */
const ALLOWED = 1e-5;

/** Diagonals below this have no weights of single precision. */
const SMALLEST = 2 ** -100;

/**
 * The largest distance of frames from what small integers make of them: in diagonals, or in the
 * largest coordinate of the block where that is more, as in streams of random numbers.
 */
function largestError({ center, diagonal: announced }, frames, fields) {
  const { nVerts, nModes } = fields;
  const sizes = frames.map((frame) => frame.reduce((most, one) => Math.max(most, Math.abs(one)), 0));
  const isFar = Math.max(...sizes) > 1000 * announced;
  const diagonal = isFar ? Math.max(...sizes) : announced;
  let largest = 0;
  for (let t = 0; t < fields.nFrames; t++) {
    const wanted = frames[t];
    const found = new Float64Array(3 * nVerts);
    for (let k = 0; k < nModes; k++) {
      const [x, y, z] = fields.weights.subarray(3 * (t * nModes + k));
      for (let v = 0; v < nVerts; v++) {
        const field = fields.fields[k * nVerts + v];
        found[3 * v] += field * x;
        found[3 * v + 1] += field * y;
        found[3 * v + 2] += field * z;
      }
    }
    for (let i = fields.correctionStarts[t]; i < fields.correctionStarts[t + 1]; i++) {
      for (let axis = 0; axis < 3; axis++) {
        found[3 * fields.correctionVertices[i] + axis] += fields.correctionOffsets[3 * i + axis];
      }
    }
    for (let v = 0; v < nVerts; v++) {
      let [square, rounding] = [0, 0];
      for (let axis = 0; axis < 3; axis++) {
        const position = wanted[3 * v + axis];
        square += (found[3 * v + axis] + center[axis] - position) ** 2;
        rounding += Math.abs(position) * 2 ** -23; // of positions to single precision
      }
      largest = Math.max(largest, (Math.sqrt(square) - rounding) / diagonal);
    }
  }
  return largest;
}

/** Fields of a block of positions, and its frames. */
async function blockOf(engine, number) {
  const { start, nFrames } = engine.info.blocks[number];
  const fields = await engine.fields(0, number, AXES, signal);
  const frames = [];
  for (let t = start; t < start + nFrames; t++) frames.push(await engine.frame(0, t, signal));
  return { fields, frames };
}

test("small integers move no vertex by more than is allowed", async () => {
  let [nCorrections, nTwice] = [0, 0];
  for (const name of REELS) {
    const engine = await engineOf(internals, bytesOf(name), "reel");
    if (engine.info.diagonal < SMALLEST) continue;
    for (const number of engine.info.blocks.keys()) {
      const { fields, frames } = await blockOf(engine, number);
      assert.ok(largestError(engine.info, frames, fields) <= ALLOWED, name);
      nCorrections += fields.correctionVertices.length;
      nTwice += fields.nModes - fields.nBlockModes;
    }
  }
  assert.ok(nCorrections > 0 && nTwice > 0);
});

test("small integers of exact positions are as near, and of 32 frames at most", async () => {
  let nParts = 0;
  for (const name of EXACTS) {
    const bytes = bytesOf(name);
    const engine = await engineOf(internals, bytes);
    const { info } = engine;
    for (const [number, { start, nFrames }] of info.blocks.entries()) {
      const { fields, frames } = await blockOf(engine, number);
      const { nModes, nVerts } = fields;
      assert.deepEqual([fields.number, fields.start, fields.nFrames], [number, start, nFrames]);
      assert.deepEqual([nModes, nVerts], [3 * nFrames + 1, info.nVerts]);
      assert.ok(nFrames <= 32);
      assert.ok(largestError(info, frames, fields) <= ALLOWED, name);
    }
    const sizes = info.blocks.reduce((sum, { sizeBytes }) => sum + sizeBytes, 0);
    const groups = groupsOf(bytes);
    const stored = groups.flat().reduce((sum, [start, end]) => sum + end - start, 0);
    assert.ok(Math.abs(sizes - stored) <= info.blocks.length);
    nParts += info.blocks.length - groups.length;
  }
  assert.ok(nParts > 0);
});

test("each mode uses all of its integers", async () => {
  const engine = await engineOf(internals, bytesOf("geometry"));
  const { fields, means, nBlockModes, nVerts } = await engine.fields(0, 0, AXES, signal);
  assert.ok(nBlockModes > 1);
  for (let k = 0; k < nBlockModes; k++) {
    const field = fields.subarray(k * nVerts, (k + 1) * nVerts);
    assert.equal(Math.max(...field.map(Math.abs)), 32767);
    const mean = field.reduce((sum, value) => sum + value, 0) / nVerts;
    assert.equal(means[k], mean);
  }
});

test("fields do not depend on what was decoded before", async () => {
  const fresh = () => engineOf(internals, bytesOf("key_blocks"));
  const { blocks } = (await fresh()).info;
  const wanted = [];
  for (const number of blocks.keys()) wanted.push(await blockOf(await fresh(), number));
  let nChecked = 0;
  for (const first of blocks.keys()) {
    for (const second of blocks.keys()) {
      for (const third of blocks.keys()) {
        const engine = await fresh();
        await engine.fields(0, first, AXES, signal);
        await engine.fields(0, second, AXES, signal);
        await engine.frame(0, blocks[third].start, signal);
        for (const number of [second, first]) {
          const { start } = blocks[number];
          assert.deepEqual(await engine.frame(0, start, signal), wanted[number].frames[0]);
          assert.deepEqual(await engine.fields(0, number, AXES, signal), wanted[number].fields);
          nChecked++;
        }
      }
    }
  }
  assert.ok(nChecked >= 54);
});
