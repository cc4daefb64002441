// Damaged and hostile bytes give an error of the package, or frames that are right; never a hang.

import assert from "node:assert/strict";
import { test } from "node:test";
import { exactModule, loadInternals, newCore } from "./support/bundle.mjs";
import { EXACTS, bytesOf, sha } from "./support/streams.mjs";

const {
  Core,
  MemoryReel,
  MeshReelError,
  POSITIONS,
  Section,
  TrackEngine,
  TruncatedStreamError,
  crc32,
  readHeader,
  readStream,
  sectionEnd,
} = await loadInternals();

/** Small streams with every kind of section that is read. */
const NAMES = ["example", "everything", "key_blocks", "max_error", "no_index", "named"];
const core = newCore(Core);

/**
 * Hashes of all frames of a stream, up to the first error, and this error; null where there is none.
 * Whatever happens, an error is of the package and no memory stays in use.
 */
function decoded(bytes) {
  const frames = [];
  let reel;
  let failure = null;
  try {
    reel = new MemoryReel(core, bytes);
    assert.ok(reel.surface.triangles.length);
    reel.info.blocks.forEach((_, number) => {
      const block = reel.decodeBlock(number);
      try {
        for (let t = 0; t < block.nFrames; t++) frames.push(sha(reel.frameOf(block, t)));
        assert.equal(reel.fieldsOf(block).nFrames, block.nFrames);
      } finally {
        block.close();
      }
    });
  } catch (error) {
    if (!(error instanceof MeshReelError)) throw error;
    assert.match(error.message, /\w+ \w+/);
    failure = error;
  }
  reel?.close();
  assert.equal(core.heap.usedBytes, 0);
  return { frames, failure };
}

/** Numbers from 0 to n - 1, at most so many of them, evenly. */
function sample(n, most) {
  const count = Math.min(n, most);
  return Array.from({ length: count }, (_, i) => Math.floor((i * n) / count));
}

test("a flipped bit gives an error, or leaves frames as they are", () => {
  for (const name of NAMES) {
    const whole = bytesOf(name);
    const wanted = decoded(whole).frames;
    let nErrors = 0;
    for (const place of sample(whole.length, 150)) {
      const bytes = whole.slice();
      bytes[place] ^= 1 << (place % 8);
      const { frames, failure } = decoded(bytes);
      assert.deepEqual(frames, wanted.slice(0, frames.length), `${name}, byte ${place}`);
      nErrors += failure !== null || frames.length < wanted.length;
    }
    assert.ok(nErrors > 50, `${name} is damaged without anything to say about it`);
  }
});

test("a stream that is cut off gives its complete blocks, or an error", () => {
  for (const name of ["key_blocks", "no_index", "everything"]) {
    const whole = bytesOf(name);
    const wanted = decoded(whole).frames;
    for (const length of [...sample(whole.length, 200), whole.length - 1]) {
      const { frames, failure } = decoded(whole.subarray(0, length));
      assert.deepEqual(frames, wanted.slice(0, frames.length), `${name}, ${length} bytes`);
      assert.ok(failure || frames.length, `${name}, ${length} bytes`);
    }
    assert.ok(decoded(whole.subarray(0, 20)).failure instanceof TruncatedStreamError);
  }
});

/** Places of the payloads of a stream, with the section of each. */
function payloadsOf(bytes) {
  const found = [];
  for (let position = readHeader(bytes).sizeBytes; position < bytes.length;) {
    const end = sectionEnd({ bytes, start: 0 }, position, bytes.length);
    let start = position + 1;
    while (bytes[start] & 0x80) start++;
    found.push({ id: bytes[position], position, start: start + 1, end });
    position = end;
  }
  return found;
}

test("damage with right checksums gives an error of the package, or some frames", () => {
  const random = randomNumbers(7);
  const hostile = ["everything", "key_blocks", "max_error", "example", "handles", "not_manifold"];
  let [nErrors, nFrames] = [0, 0];
  for (const name of hostile) {
    const whole = bytesOf(name);
    const payloads = payloadsOf(whole).filter(({ start, end }) => end - 4 > start);
    assert.ok(payloads.some(({ id }) => id === Section.COEFFICIENTS));
    for (let turn = 0; turn < 75; turn++) {
      const bytes = whole.slice();
      const { position, start, end } = payloads[turn % payloads.length];
      const nDamaged = 1 + Math.floor(3 * random());
      for (let i = 0; i < nDamaged; i++) {
        bytes[start + Math.floor((end - 4 - start) * random())] = Math.floor(256 * random());
      }
      const sum = crc32(bytes.subarray(position, end - 4));
      new DataView(bytes.buffer).setUint32(end - 4, sum, true);
      const { frames, failure } = decoded(bytes);
      nErrors += failure !== null;
      nFrames += frames.length;
    }
  }
  assert.ok(nErrors > 50 && nFrames > 50);
});

test("damaged hard edges give an error of the package, or edges of the mesh", () => {
  const whole = bytesOf("hard_edges");
  const { position, start, end } = payloadsOf(whole).find(({ id }) => id === Section.HARD_EDGES);
  let nErrors = 0;
  for (let place = start; place < end - 4; place++) {
    for (let value = 0; value < 256; value += 3) {
      const bytes = whole.slice();
      bytes[place] = value;
      const sum = crc32(bytes.subarray(position, end - 4));
      new DataView(bytes.buffer).setUint32(end - 4, sum, true);
      try {
        const { surface } = new MemoryReel(core, bytes);
        const edges = Array.from(surface.hardEdges.keys()).filter((i) => i % 2 === 0);
        for (const i of edges) assert.ok(surface.hardEdges[i] < surface.hardEdges[i + 1]);
        assert.ok(surface.hardEdges.every((vertex) => vertex < 16));
      } catch (error) {
        if (!(error instanceof MeshReelError)) throw error;
        nErrors++;
      }
    }
  }
  assert.ok(nErrors > 50, `${nErrors} errors`);
});

/**
 * Frames of a stream of exact positions, each by its hash or null where its block is damaged, and
 * the last error, which is of the package.
 */
async function exactlyDecoded(bytes) {
  const { signal } = new AbortController();
  const read = async (from, to) => bytes.slice(from, to);
  const frames = [];
  let failure = null;
  const attempt = async (work) => {
    try {
      return await work();
    } catch (error) {
      if (!(error instanceof MeshReelError)) throw error;
      failure = error;
      return null;
    }
  };
  await attempt(async () => {
    const { info } = new MemoryReel(core, bytes);
    const engine = new TrackEngine(newCore(Core), read, readStream(bytes), async () => exactModule());
    for (let t = 0; t < info.nFrames; t++) {
      const found = await attempt(() => engine.values(POSITIONS, t, signal));
      if (found) assert.ok(found.every(Number.isFinite));
      frames.push(found && sha(found));
    }
    for (const [number, { nFrames }] of info.blocks.entries()) {
      const fields = await attempt(() => engine.fields(POSITIONS, number, [0, 1, 2], signal));
      if (fields) assert.equal(fields.nFrames, nFrames);
    }
  });
  return { frames, failure };
}

test("a flipped bit in exact positions gives an error, or leaves frames as they are", async () => {
  for (const name of EXACTS) {
    const whole = bytesOf(name);
    const wanted = (await exactlyDecoded(whole)).frames;
    assert.ok(!wanted.includes(null));
    let nErrors = 0;
    for (const place of sample(whole.length, 20)) {
      const bytes = whole.slice();
      bytes[place] ^= 1 << (place % 8);
      const { frames, failure } = await exactlyDecoded(bytes);
      frames.forEach((one, t) => assert.ok(one === null || one === wanted[t], `${name}, ${place}`));
      nErrors += failure !== null || frames.length < wanted.length;
    }
    assert.ok(nErrors > 5, `${name} is damaged without anything to say about it`);
  }
});

test("damage in exact positions with right checksums gives an error of the package", async () => {
  const random = randomNumbers(11);
  let [nErrors, nFrames] = [0, 0];
  for (const name of EXACTS) {
    const whole = bytesOf(name);
    const payloads = payloadsOf(whole).filter(({ start, end }) => end - 4 > start);
    const values = payloads.filter(({ id }) => id === Section.VALUES || id === Section.BLOCK);
    for (let turn = 0; turn < 12; turn++) {
      const bytes = whole.slice();
      const of = turn % 2 ? values : payloads;
      const { position, start, end } = of[(turn >> 1) % of.length];
      bytes[start + Math.floor((end - 4 - start) * random())] = Math.floor(256 * random());
      const sum = crc32(bytes.subarray(position, end - 4));
      new DataView(bytes.buffer).setUint32(end - 4, sum, true);
      const { frames, failure } = await exactlyDecoded(bytes);
      nErrors += failure !== null;
      nFrames += frames.filter((one) => one !== null).length;
    }
  }
  assert.ok(nErrors > 50 && nFrames > 50, `${nErrors} errors, ${nFrames} frames`);
});

test("sizes in the header that the bytes cannot hold are refused before memory is taken", () => {
  const bytes = bytesOf("example");
  const header = readHeader(bytes);
  for (const place of [10, 14, 18]) {
    const announced = bytes.slice();
    const view = new DataView(announced.buffer);
    view.setUint32(place, 0xffffffff, true);
    view.setUint32(header.sizeBytes - 4, crc32(announced.subarray(0, header.sizeBytes - 4)), true);
    const before = core.functions.memory.buffer.byteLength;
    assert.throws(() => new MemoryReel(core, announced), MeshReelError);
    assert.equal(core.functions.memory.buffer.byteLength, before);
  }
});

test("bytes of other files are named as such", () => {
  const file = new TextEncoder().encode("<html><body>not found</body></html>");
  assert.throws(
    () => new MemoryReel(core, file),
    /not a \.reel stream: this is an HTML page; is the address right\?/,
  );
  assert.throws(() => new MemoryReel(core, new Uint8Array(0)), /the stream is empty \(0 bytes\)/);
});

/** Random numbers of 0..1, the same each time. */
function randomNumbers(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}
