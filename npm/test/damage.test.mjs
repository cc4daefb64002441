// Damaged and malicious bytes cause an error of the package or are harmless, and never hang.

import assert from "node:assert/strict";
import { test } from "node:test";
import { openEngine, loadInternals } from "./support/bundle.mjs";
import {
  BLOCK,
  COEFFICIENTS,
  FRAMES_AT,
  HARD_EDGES,
  TRACK,
  VALUES,
  headerSize,
  seal,
  sealHeader,
  sectionsOf,
  varint,
} from "./support/container.mjs";
import { EXACTS, PLAYED, streamBytes, expectedOf, sha } from "./support/streams.mjs";

const internals = await loadInternals();
const { MemoryLimitError, MeshReelError, TruncatedStreamError } = internals;
const { signal } = new AbortController();

/** Small streams that contain all kinds of sections. */
const NAMES = ["example", "everything", "key_blocks", "max_error", "no_index", "named"];
const WITH_TRACKS = PLAYED.filter((name) => expectedOf(name).tracks);

/**
 * Decode all frames of a stream, and of its tracks; returns their hashes, null for damaged ones, and
 * the last error. All errors must be errors of the package with a message.
 */
async function decodeAll(bytes, withTracks = false) {
  const frames = [];
  let failure = null;
  const attempt = async (work) => {
    try {
      return await work();
    } catch (error) {
      if (!(error instanceof MeshReelError)) throw error;
      assert.match(error.message, /\w+ \w+/);
      failure = error;
      return null;
    }
  };
  await attempt(async () => {
    const engine = await openEngine(internals, bytes);
    assert.ok(engine.surface.triangles.length);
    const { nFrames, blocks, tracks } = engine.info;
    for (let track = 0; track <= (withTracks ? tracks.length : 0); track++) {
      for (let t = 0; t < nFrames; t++) {
        const frame = await attempt(() => engine.frame(track, t, signal));
        if (frame && !track) assert.ok(frame.every(Number.isFinite));
        frames.push(frame && sha(frame));
      }
      for (const [number, block] of blocks.entries()) {
        const fields = await attempt(() => engine.fields(track, number, [0], signal));
        if (fields) assert.equal(fields.nFrames, block.nFrames);
      }
    }
  });
  return { frames, failure };
}

/** Whether each frame is right or missing. */
function areRight(frames, expected) {
  return frames.every((frame, i) => frame === null || frame === expected[i]);
}

/** At most `maxCount` evenly spaced integers from 0 to n - 1. */
function sample(n, maxCount) {
  const count = Math.min(n, maxCount);
  return Array.from({ length: count }, (_, i) => Math.floor((i * n) / count));
}

test("a flipped bit causes an error or does not change frames", async () => {
  for (const [names, nPositions] of [[NAMES, 50], [EXACTS, 10]]) {
    for (const name of names) {
      const whole = streamBytes(name);
      const expected = (await decodeAll(whole)).frames;
      assert.ok(!expected.includes(null));
      let nErrors = 0;
      for (const position of sample(whole.length, nPositions)) {
        const bytes = whole.slice();
        bytes[position] ^= 1 << (position % 8);
        const { frames, failure } = await decodeAll(bytes);
        assert.ok(areRight(frames, expected), `${name}, byte ${position}`);
        nErrors += failure !== null || frames.length < expected.length;
      }
      assert.ok(nErrors > nPositions / 4, `damage of ${name} goes unnoticed`);
    }
  }
});

test("a truncated stream yields its complete blocks or an error", async () => {
  for (const name of ["key_blocks", "no_index", "everything"]) {
    const whole = streamBytes(name);
    const expected = (await decodeAll(whole)).frames;
    for (const length of [...sample(whole.length, 70), whole.length - 1]) {
      const { frames, failure } = await decodeAll(whole.subarray(0, length));
      assert.deepEqual(frames, expected.slice(0, frames.length), `${name}, ${length} bytes`);
      assert.ok(failure || frames.length, `${name}, ${length} bytes`);
    }
    assert.ok((await decodeAll(whole.subarray(0, 20))).failure instanceof TruncatedStreamError);
  }
});

/** Change one to three bytes of a payload, and update its checksum. */
function damage(whole, section, random) {
  const bytes = whole.slice();
  const { begin, payload } = section;
  for (let i = 0; i < 1 + Math.floor(3 * random()); i++) {
    bytes[begin + Math.floor(payload.length * random())] = Math.floor(256 * random());
  }
  seal(bytes, section);
  return bytes;
}

test("damage with valid checksums causes an error of the package or yields frames", async () => {
  const random = randomNumbers(7);
  const hostile = ["everything", "key_blocks", "max_error", "example", "handles", "not_manifold"];
  let [nErrors, nFrames] = [0, 0];
  for (const [names, nTurns, ids] of [
    [hostile, 25, null],
    [EXACTS, 3, null],
    [EXACTS, 3, [VALUES, BLOCK]],
    [WITH_TRACKS, 9, [TRACK, VALUES, COEFFICIENTS]],
  ]) {
    for (const name of names) {
      const whole = streamBytes(name);
      const payloads = sectionsOf(whole).filter(({ payload }) => payload.length);
      const candidates = ids ? payloads.filter(({ id }) => ids.includes(id)) : payloads;
      for (let turn = 0; turn < nTurns; turn++) {
        const bytes = damage(whole, candidates[turn % candidates.length], random);
        const { frames, failure } = await decodeAll(bytes, names === WITH_TRACKS);
        nErrors += failure !== null;
        nFrames += frames.filter((hash) => hash !== null).length;
      }
    }
  }
  assert.ok(nErrors > 200 && nFrames > 1000, `${nErrors} errors, ${nFrames} frames`);
});

test("damaged hard edges cause an error of the package or yield edges of the mesh", async () => {
  const whole = streamBytes("hard_edges");
  const section = sectionsOf(whole).find(({ id }) => id === HARD_EDGES);
  let nErrors = 0;
  for (let position = section.begin; position < section.end - 4; position++) {
    for (let value = 0; value < 256; value += 15) {
      const bytes = whole.slice();
      bytes[position] = value;
      seal(bytes, section);
      try {
        const { hardEdges } = (await openEngine(internals, bytes)).surface;
        const edges = Array.from(hardEdges.keys()).filter((i) => i % 2 === 0);
        for (const i of edges) assert.ok(hardEdges[i] < hardEdges[i + 1]);
        assert.ok(hardEdges.every((vertex) => vertex < 16));
      } catch (error) {
        if (!(error instanceof MeshReelError)) throw error;
        nErrors++;
      }
    }
  }
  assert.ok(nErrors > 30, `${nErrors} errors`);
});

test("header sizes that exceed the file are rejected before memory is allocated", async () => {
  const example = streamBytes("example");
  for (const position of [FRAMES_AT + 1, FRAMES_AT + 2]) {
    const after = example.subarray(position + 1);
    const bytes = Uint8Array.from([...example.subarray(0, position), ...varint(0x3ffffff), ...after]);
    sealHeader(bytes);
    const before = process.memoryUsage().arrayBuffers;
    await assert.rejects(openEngine(internals, bytes), MeshReelError);
    assert.ok(process.memoryUsage().arrayBuffers < before + 2 ** 26);
  }
});

test("streams that exceed the memory limit are rejected", async () => {
  const bytes = streamBytes("geometry");
  await assert.rejects(openEngine(internals, bytes, { memory: 10_000 }), (error) => {
    const message = /^decoding needs \d+ bytes of memory; the limit is 10000: open the file with a larger `memory`$/;
    assert.match(error.message, message);
    return error instanceof MemoryLimitError;
  });
});

test("a header with any bit flipped, or truncated anywhere, is rejected", async () => {
  const bytes = streamBytes("named");
  const size = headerSize(bytes);
  for (let bit = 0; bit < 8 * size; bit++) {
    const changed = bytes.slice();
    changed[bit >> 3] ^= 1 << (bit & 7);
    await assert.rejects(openEngine(internals, changed), { name: /^(Corrupt|Truncated|Unsupp)/ });
  }
  for (let length = 0; length < size; length++) {
    await assert.rejects(openEngine(internals, bytes.subarray(0, length)), TruncatedStreamError);
  }
});

/** Create a deterministic generator of random numbers in [0, 1). */
function randomNumbers(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}
