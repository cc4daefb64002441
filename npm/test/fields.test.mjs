// Blocks as small integers make the frames that the decoder makes, nearly.

import assert from "node:assert/strict";
import { test } from "node:test";
import { loadInternals, newCore } from "./support/bundle.mjs";
import { REELS, bytesOf } from "./support/streams.mjs";

const { Core, InvalidInputError, MemoryReel } = await loadInternals();

/** How far integers may move a vertex, in diagonals. */
const ALLOWED = 1e-5;

/** Diagonals below this have no weights of single precision. */
const SMALLEST = 2 ** -100;

/** The largest distance of frames from what small integers make of them, in diagonals. */
function largestError(reel, block, fields) {
  const { nVerts, nModes } = fields;
  const { center, diagonal } = reel.info;
  let largest = 0;
  for (let t = 0; t < fields.nFrames; t++) {
    const wanted = reel.frameOf(block, t);
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

test("small integers move no vertex by more than is allowed", () => {
  let nCorrections = 0;
  let nTwice = 0;
  for (const name of REELS) {
    const reel = new MemoryReel(newCore(Core), bytesOf(name));
    if (reel.info.diagonal < SMALLEST) continue;
    reel.info.blocks.forEach((_, number) => {
      const block = reel.decodeBlock(number);
      const fields = reel.fieldsOf(block);
      assert.ok(largestError(reel, block, fields) <= ALLOWED, name);
      nCorrections += fields.correctionVertices.length;
      nTwice += fields.nModes - block.nModes;
      block.close();
    });
  }
  assert.ok(nCorrections > 0 && nTwice > 0);
});

test("each mode uses all of its integers", () => {
  const reel = new MemoryReel(newCore(Core), bytesOf("geometry"));
  const block = reel.decodeBlock(0);
  const { fields, means, nBlockModes, nVerts } = reel.fieldsOf(block);
  assert.equal(nBlockModes, block.nModes);
  for (let k = 0; k < block.nModes; k++) {
    const field = fields.subarray(k * nVerts, (k + 1) * nVerts);
    assert.equal(Math.max(...field.map(Math.abs)), 32767);
    const mean = field.reduce((sum, value) => sum + value, 0) / nVerts;
    assert.equal(means[k], mean);
  }
});

test("a block can be used until it is closed, and not behind that", () => {
  const reel = new MemoryReel(newCore(Core), bytesOf("key_blocks"));
  const block = reel.decodeBlock(0);
  const before = reel.frameOf(block, 0);
  reel.decodeBlock(1).close();
  assert.deepEqual(reel.frameOf(block, 0), before);
  block.close();
  block.close();
  assert.throws(() => reel.frameOf(block, 0), /block 0 is closed/);
  assert.throws(() => reel.fieldsOf(block), InvalidInputError);
});

test("frames and blocks that are not there, and arrays that do not fit, are refused", () => {
  const reel = new MemoryReel(newCore(Core), bytesOf("geometry"));
  const block = reel.decodeBlock(0);
  for (const time of [-1, 0.5, block.nFrames, NaN]) {
    assert.throws(() => reel.frameOf(block, time), InvalidInputError);
  }
  assert.throws(() => reel.decodeBlock(reel.info.blocks.length), InvalidInputError);
  const length = 3 * reel.info.nVerts;
  assert.throws(() => reel.frameOf(block, 0, new Float32Array(length - 1)), InvalidInputError);
  assert.throws(() => reel.frameOf(block, 0, new Float64Array(length)), InvalidInputError);
  const into = new Float32Array(length);
  assert.equal(reel.frameOf(block, 0, into), into);
  assert.deepEqual(into, reel.frameOf(block, 0));
});
