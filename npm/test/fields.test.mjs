// Blocks as small integers make the frames that the decoder makes, nearly.

import assert from "node:assert/strict";
import { test } from "node:test";
import { exactModule, loadInternals, newCore } from "./support/bundle.mjs";
import { EXACTS, REELS, bytesOf } from "./support/streams.mjs";

const {
  Core,
  CorruptStreamError,
  InvalidInputError,
  MemoryReel,
  ModesBlock,
  POSITIONS,
  TrackEngine,
  readStream,
} = await loadInternals();

/** How far integers may move a vertex, in diagonals. */
const ALLOWED = 1e-5;

/** Diagonals below this have no weights of single precision. */
const SMALLEST = 2 ** -100;

/** The largest distance of frames from what small integers make of them, in diagonals. */
function largestError({ center, diagonal }, frames, fields) {
  const { nVerts, nModes } = fields;
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

test("small integers move no vertex by more than is allowed", () => {
  let nCorrections = 0;
  let nTwice = 0;
  for (const name of REELS) {
    const reel = new MemoryReel(newCore(Core), bytesOf(name));
    if (reel.info.diagonal < SMALLEST) continue;
    reel.info.blocks.forEach((_, number) => {
      const block = reel.decodeBlock(number);
      const fields = reel.fieldsOf(block);
      const frames = Array.from({ length: fields.nFrames }, (_, t) => reel.frameOf(block, t));
      assert.ok(largestError(reel.info, frames, fields) <= ALLOWED, name);
      nCorrections += fields.correctionVertices.length;
      nTwice += fields.nModes - block.nModes;
      block.close();
    });
  }
  assert.ok(nCorrections > 0 && nTwice > 0);
});

test("small integers of exact positions are as near, and of 32 frames at most", async () => {
  const { signal } = new AbortController();
  let nParts = 0;
  for (const name of EXACTS) {
    const bytes = bytesOf(name);
    const { info } = new MemoryReel(newCore(Core), bytes);
    const stream = readStream(bytes);
    const read = async (from, to) => bytes.slice(from, to);
    const engine = new TrackEngine(newCore(Core), read, stream, async () => exactModule());
    for (const [number, { start, nFrames }] of info.blocks.entries()) {
      const fields = await engine.fields(POSITIONS, number, [0, 1, 2], signal);
      const { nModes, nVerts } = fields;
      assert.deepEqual([fields.number, fields.start, fields.nFrames], [number, start, nFrames]);
      assert.deepEqual([nModes, nVerts], [3 * nFrames + 1, info.nVerts]);
      assert.ok(nFrames <= 32);
      const frames = [];
      for (let t = 0; t < nFrames; t++) {
        frames.push(await engine.values(POSITIONS, start + t, signal));
      }
      assert.ok(largestError(info, frames, fields) <= ALLOWED, name);
    }
    const sizes = info.blocks.reduce((sum, { sizeBytes }) => sum + sizeBytes, 0);
    const stored = stream.places.reduce((sum, place) => sum + place.sizes.reduce((a, b) => a + b), 0);
    assert.ok(Math.abs(sizes - stored) <= info.blocks.length);
    nParts += info.blocks.length - stream.places.length;
  }
  assert.ok(nParts > 0);
});

test("fields of some frames of a track with modes are those of the whole block", () => {
  const reel = new MemoryReel(newCore(Core), bytesOf("corrections"));
  const { header } = readStream(bytesOf("corrections"));
  const core = reel.core;
  const block = reel.decodeBlock(0);
  const track = new ModesBlock(core, { kind: "vector", placement: header }, block, null);
  const { nFrames, nVerts } = block;
  assert.ok(nFrames > 4);
  const frames = Array.from({ length: nFrames }, (_, t) => reel.frameOf(block, t));
  const { center, diagonal } = reel.info;
  let nCorrections = 0;
  for (const [first, count] of [[0, nFrames], [0, 3], [1, nFrames - 2], [nFrames - 2, 2]]) {
    const fields = track.fields([0, 1, 2], first, count);
    assert.equal(fields.nFrames, count);
    assert.equal(fields.weights.length, 3 * count * fields.nModes);
    assert.equal(fields.correctionStarts[0], 0);
    assert.equal(fields.correctionStarts[count], fields.correctionVertices.length);
    assert.equal(fields.nVerts, nVerts);
    nCorrections += fields.correctionVertices.length;
    const wanted = frames.slice(first, first + count);
    assert.ok(largestError({ center, diagonal }, wanted, fields) <= ALLOWED);
  }
  assert.ok(nCorrections > block.corrections.vertices.length);
});

test("a block without modes of a file that has some, and the reverse, is damaged", async () => {
  const { signal } = new AbortController();
  for (const [name, method] of [["sphere", 8], ["sphere", 9]]) {
    const bytes = bytesOf(name);
    const stream = readStream(bytes);
    const header = { ...stream.header, method };
    const read = async (from, to) => bytes.slice(from, to);
    const all = [newCore(Core), read, { ...stream, header }, async () => exactModule()];
    await assert.rejects(new TrackEngine(...all).values(POSITIONS, 0, signal), (error) => {
      assert.match(error.message, /exact positions have no modes/);
      return error instanceof CorruptStreamError;
    });
  }
  const reel = new MemoryReel(newCore(Core), bytesOf("lossless"));
  assert.throws(() => reel.decodeBlock(0), /12 frames and 0 modes; each must be at least 1/);
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
