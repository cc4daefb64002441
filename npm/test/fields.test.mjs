// Fields for shaders reproduce the decoded frames within a tolerance.

import assert from "node:assert/strict";
import { test } from "node:test";
import { openEngine, loadInternals } from "./support/bundle.mjs";
import { groupsOf } from "./support/container.mjs";
import { EXACTS, REELS, streamBytes } from "./support/streams.mjs";

const internals = await loadInternals();
const { signal } = new AbortController();
const AXES = [0, 1, 2];

/** Largest allowed displacement of a vertex by rounding, in diagonals. */
const TOLERANCE = 1e-5;

/** Weights of meshes with a smaller diagonal underflow float32. */
const MIN_DIAGONAL = 2 ** -100;

/**
 * Largest distance between decoded positions and those from fields, in diagonals, or relative to
 * the largest coordinate if that is much larger, as in streams of random numbers.
 */
function largestError({ center, diagonal: stored }, frames, fields) {
  const { nVerts, nModes } = fields;
  const maxima = frames.map((frame) => frame.reduce((max, one) => Math.max(max, Math.abs(one)), 0));
  const isFar = Math.max(...maxima) > 1000 * stored;
  const diagonal = isFar ? Math.max(...maxima) : stored;
  let maxError = 0;
  for (let t = 0; t < fields.nFrames; t++) {
    const decoded = frames[t];
    const sums = new Float64Array(3 * nVerts);
    for (let k = 0; k < nModes; k++) {
      const [x, y, z] = fields.weights.subarray(3 * (t * nModes + k));
      for (let v = 0; v < nVerts; v++) {
        const field = fields.fields[k * nVerts + v];
        sums[3 * v] += field * x;
        sums[3 * v + 1] += field * y;
        sums[3 * v + 2] += field * z;
      }
    }
    for (let i = fields.correctionStarts[t]; i < fields.correctionStarts[t + 1]; i++) {
      for (let axis = 0; axis < 3; axis++) {
        sums[3 * fields.correctionVertices[i] + axis] += fields.correctionOffsets[3 * i + axis];
      }
    }
    for (let v = 0; v < nVerts; v++) {
      let [square, rounding] = [0, 0];
      for (let axis = 0; axis < 3; axis++) {
        const position = decoded[3 * v + axis];
        square += (sums[3 * v + axis] + center[axis] - position) ** 2;
        rounding += Math.abs(position) * 2 ** -23; // of positions to float32
      }
      maxError = Math.max(maxError, (Math.sqrt(square) - rounding) / diagonal);
    }
  }
  return maxError;
}

/** Decode a block of positions as fields and as frames. */
async function decodeBlock(engine, number) {
  const { start, nFrames } = engine.info.blocks[number];
  const fields = await engine.fields(0, number, AXES, signal);
  const frames = [];
  for (let t = start; t < start + nFrames; t++) frames.push(await engine.frame(0, t, signal));
  return { fields, frames };
}

test("fields of positions are within the tolerance", async () => {
  let nCorrections = 0;
  for (const name of REELS) {
    const engine = await openEngine(internals, streamBytes(name));
    if (engine.info.diagonal < MIN_DIAGONAL) continue;
    for (const number of engine.info.blocks.keys()) {
      const { fields, frames } = await decodeBlock(engine, number);
      assert.ok(largestError(engine.info, frames, fields) <= TOLERANCE, name);
      nCorrections += fields.correctionVertices.length;
    }
  }
  assert.ok(nCorrections > 0);
});

test("fields of exact positions are within the tolerance, with at most 32 frames", async () => {
  let nParts = 0;
  for (const name of EXACTS) {
    const bytes = streamBytes(name);
    const engine = await openEngine(internals, bytes);
    const { info } = engine;
    for (const [number, { start, nFrames }] of info.blocks.entries()) {
      const { fields, frames } = await decodeBlock(engine, number);
      const { nModes, nVerts } = fields;
      assert.deepEqual([fields.index, fields.start, fields.nFrames], [number, start, nFrames]);
      assert.deepEqual([nModes, nVerts], [3 * nFrames + 1, info.nVerts]);
      assert.ok(nFrames <= 32);
      assert.ok(largestError(info, frames, fields) <= TOLERANCE, name);
    }
    const sizes = info.blocks.reduce((sum, { sizeBytes }) => sum + sizeBytes, 0);
    const groups = groupsOf(bytes);
    const stored = groups.flat().reduce((sum, [start, end]) => sum + end - start, 0);
    assert.ok(Math.abs(sizes - stored) <= info.blocks.length);
    nParts += info.blocks.length - groups.length;
  }
  assert.ok(nParts > 0);
});

test("each mode uses the full range of integers", async () => {
  const engine = await openEngine(internals, streamBytes("geometry"));
  const { fields, means, nModes, nVerts } = await engine.fields(0, 0, AXES, signal);
  assert.ok(nModes > 1);
  for (let k = 0; k < nModes; k++) {
    const field = fields.subarray(k * nVerts, (k + 1) * nVerts);
    if (k < 2) assert.equal(Math.max(...field.map(Math.abs)), 32767); // the last are residuals
    const mean = field.reduce((sum, value) => sum + value, 0) / nVerts;
    assert.equal(means[k], mean);
  }
});

test("fields do not depend on previously decoded blocks", async () => {
  const fresh = () => openEngine(internals, streamBytes("key_blocks"));
  const { blocks } = (await fresh()).info;
  const expected = [];
  for (const number of blocks.keys()) expected.push(await decodeBlock(await fresh(), number));
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
          assert.deepEqual(await engine.frame(0, start, signal), expected[number].frames[0]);
          assert.deepEqual(await engine.fields(0, number, AXES, signal), expected[number].fields);
          nChecked++;
        }
      }
    }
  }
  assert.ok(nChecked >= 54);
});
