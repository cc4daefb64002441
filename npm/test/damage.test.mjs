// Damaged and hostile bytes give an error of the package, or values that are right; never a hang.

import assert from "node:assert/strict";
import { test } from "node:test";
import { engineOf, loadInternals } from "./support/bundle.mjs";
import {
  BLOCK,
  COEFFICIENTS,
  HARD_EDGES,
  TRACK,
  VALUES,
  headerSize,
  seal,
  sealHeader,
  sectionsOf,
} from "./support/container.mjs";
import { EXACTS, PLAYED, bytesOf, said, sha } from "./support/streams.mjs";

const internals = await loadInternals();
const { MemoryLimitError, MeshReelError, TruncatedStreamError } = internals;
const { signal } = new AbortController();

/** Small streams with every kind of section that is read. */
const NAMES = ["example", "everything", "key_blocks", "max_error", "no_index", "named"];
const WITH_TRACKS = PLAYED.filter((name) => said(name).tracks);

/**
 * Hashes of all frames of a stream and of its tracks, null where one is damaged, and the last error.
 * All errors must be of the package and have a message.
 */
async function decoded(bytes, withTracks = false) {
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
    const engine = await engineOf(internals, bytes);
    assert.ok(engine.surface.triangles.length);
    const { nFrames, blocks, tracks } = engine.info;
    for (let track = 0; track <= (withTracks ? tracks.length : 0); track++) {
      for (let t = 0; t < nFrames; t++) {
        const found = await attempt(() => engine.frame(track, t, signal));
        if (found && !track) assert.ok(found.every(Number.isFinite));
        frames.push(found && sha(found));
      }
      for (const [number, block] of blocks.entries()) {
        const fields = await attempt(() => engine.fields(track, number, [0], signal));
        if (fields) assert.equal(fields.nFrames, block.nFrames);
      }
    }
  });
  return { frames, failure };
}

/** Whether each frame is that which is wanted, or missing. */
function areRight(frames, wanted) {
  return frames.every((frame, i) => frame === null || frame === wanted[i]);
}

/** Numbers from 0 to n - 1, at most so many of them, evenly. */
function sample(n, most) {
  const count = Math.min(n, most);
  return Array.from({ length: count }, (_, i) => Math.floor((i * n) / count));
}

test("a flipped bit gives an error, or leaves frames as they are", async () => {
  for (const [names, nPlaces] of [[NAMES, 150], [EXACTS, 20]]) {
    for (const name of names) {
      const whole = bytesOf(name);
      const wanted = (await decoded(whole)).frames;
      assert.ok(!wanted.includes(null));
      let nErrors = 0;
      for (const place of sample(whole.length, nPlaces)) {
        const bytes = whole.slice();
        bytes[place] ^= 1 << (place % 8);
        const { frames, failure } = await decoded(bytes);
        assert.ok(areRight(frames, wanted), `${name}, byte ${place}`);
        nErrors += failure !== null || frames.length < wanted.length;
      }
      assert.ok(nErrors > nPlaces / 3, `${name} is damaged without anything to say about it`);
    }
  }
});

test("a stream that is cut off gives its complete blocks, or an error", async () => {
  for (const name of ["key_blocks", "no_index", "everything"]) {
    const whole = bytesOf(name);
    const wanted = (await decoded(whole)).frames;
    for (const length of [...sample(whole.length, 200), whole.length - 1]) {
      const { frames, failure } = await decoded(whole.subarray(0, length));
      assert.deepEqual(frames, wanted.slice(0, frames.length), `${name}, ${length} bytes`);
      assert.ok(failure || frames.length, `${name}, ${length} bytes`);
    }
    assert.ok((await decoded(whole.subarray(0, 20))).failure instanceof TruncatedStreamError);
  }
});

/** Changes one to three bytes of a payload, and its checksum. */
function damaged(whole, section, random) {
  const bytes = whole.slice();
  const { begin, end } = section;
  for (let i = 0; i < 1 + Math.floor(3 * random()); i++) {
    bytes[begin + Math.floor((end - 4 - begin) * random())] = Math.floor(256 * random());
  }
  seal(bytes, section);
  return bytes;
}

test("damage with right checksums gives an error of the package, or some frames", async () => {
  const random = randomNumbers(7);
  const hostile = ["everything", "key_blocks", "max_error", "example", "handles", "not_manifold"];
  let [nErrors, nFrames] = [0, 0];
  for (const [names, nTurns, ids] of [
    [hostile, 75, null],
    [EXACTS, 6, null],
    [EXACTS, 6, [VALUES, BLOCK]],
    [WITH_TRACKS, 20, [TRACK, VALUES, COEFFICIENTS]],
  ]) {
    for (const name of names) {
      const whole = bytesOf(name);
      const payloads = sectionsOf(whole).filter(({ payload }) => payload.length);
      const of = ids ? payloads.filter(({ id }) => ids.includes(id)) : payloads;
      for (let turn = 0; turn < nTurns; turn++) {
        const bytes = damaged(whole, of[turn % of.length], random);
        const { frames, failure } = await decoded(bytes, names === WITH_TRACKS);
        nErrors += failure !== null;
        nFrames += frames.filter((one) => one !== null).length;
      }
    }
  }
  assert.ok(nErrors > 200 && nFrames > 1000, `${nErrors} errors, ${nFrames} frames`);
});

test("damaged hard edges give an error of the package, or edges of the mesh", async () => {
  const whole = bytesOf("hard_edges");
  const section = sectionsOf(whole).find(({ id }) => id === HARD_EDGES);
  let nErrors = 0;
  for (let place = section.begin; place < section.end - 4; place++) {
    for (let value = 0; value < 256; value += 5) {
      const bytes = whole.slice();
      bytes[place] = value;
      seal(bytes, section);
      try {
        const { hardEdges } = (await engineOf(internals, bytes)).surface;
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

test("sizes in the header that the bytes cannot hold are refused before memory is taken", async () => {
  for (const place of [14, 18]) {
    const announced = bytesOf("example").slice();
    new DataView(announced.buffer).setUint32(place, 0x3ffffff, true);
    sealHeader(announced);
    const before = process.memoryUsage().arrayBuffers;
    await assert.rejects(engineOf(internals, announced), MeshReelError);
    assert.ok(process.memoryUsage().arrayBuffers < before + 2 ** 26);
  }
});

test("what takes more memory than allowed is refused", async () => {
  const bytes = bytesOf("geometry");
  await assert.rejects(engineOf(internals, bytes, "reel", 10_000), (error) => {
    assert.match(error.message, /^decoding takes \d+ bytes of memory; 10000 are allowed: open it with more `memory`$/);
    return error instanceof MemoryLimitError;
  });
});

test("a header that is changed in any bit, or cut anywhere, is refused", async () => {
  const bytes = bytesOf("named");
  const size = headerSize(bytes);
  for (let bit = 0; bit < 8 * size; bit++) {
    const changed = bytes.slice();
    changed[bit >> 3] ^= 1 << (bit & 7);
    await assert.rejects(engineOf(internals, changed), { name: /^(Corrupt|Truncated|Unsupp)/ });
  }
  for (let length = 0; length < size; length++) {
    await assert.rejects(engineOf(internals, bytes.subarray(0, length)), TruncatedStreamError);
  }
});

/** Random numbers of 0..1, the same each time. */
function randomNumbers(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}
