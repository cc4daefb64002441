// What an engine reads from a file, and the memory that it allocates.

import assert from "node:assert/strict";
import { test } from "node:test";
import { openEngine, openSegments, loadInternals, newLibrary } from "./support/bundle.mjs";
import { BLOCK, groupsOf, IMAGE, sectionBytes, sectionsOf } from "./support/container.mjs";
import { streamBytes, expectedOf, sha } from "./support/streams.mjs";

const internals = await loadInternals();
const { Heap, Library, Ranges, SegmentsEngine, SourceError } = internals;
const { signal } = new AbortController();

/** Open a file that is padded before its blocks and lacks its END; returns the engine and its reads. */
async function recordingEngine(name, { padding = 0, change = () => {} } = {}) {
  const whole = streamBytes(name);
  const first = sectionsOf(whole).find(({ id }) => id === BLOCK).position;
  const skipped = sectionBytes(0xc0, new Uint8Array(padding));
  const bytes = Uint8Array.from(Buffer.concat([whole.slice(0, first), skipped, whole.slice(first, -14)]));
  change(bytes);
  const { engine, reads } = await openSegments(internals, bytes);
  return { engine, reads, bytes };
}

async function framesHash(engine) {
  const frames = [];
  for (let t = 0; t < engine.info.nFrames; t++) frames.push(await engine.frame(0, t, signal));
  return sha(...frames);
}

test("a small file is read by one request", async () => {
  const { engine, reads, bytes } = await recordingEngine("key_blocks");
  assert.equal(await framesHash(engine), expectedOf("key_blocks")["hash of positions"]);
  assert.deepEqual(reads, [[0, bytes.length]]);
});

test("a file without its end is read entirely, once", async () => {
  const { engine, reads, bytes } = await recordingEngine("key_blocks", { padding: 200_000 });
  assert.equal(await framesHash(engine), expectedOf("key_blocks")["hash of positions"]);
  const [head, tail, ...more] = reads;
  assert.deepEqual([head, tail], [[0, 65536], [bytes.length - 4096, bytes.length]]);
  assert.ok(more.length <= 2 && more.at(-1)[1] === bytes.length, String(more));
});

test("a file that is shorter than its announced size is an error", async () => {
  const bytes = new Uint8Array(200_000);
  bytes.set(streamBytes("key_blocks"));
  const read = async (start, end) => bytes.slice(start, Math.min(end, 70_000));
  const parameters = { size: bytes.length, hasRanges: true, memory: 2 ** 31 };
  const open = SegmentsEngine.open(await newLibrary(Library), new Ranges(), read, parameters, signal);
  await assert.rejects(open, SourceError);
});

test("of a body of unknown size that is no .reel, only the first bytes are read", async () => {
  const reads = [];
  const read = async (start, end) => (reads.push([start, end]), new Uint8Array(65536));
  const parameters = { size: null, hasRanges: false, memory: 2 ** 31 };
  const open = SegmentsEngine.open(await newLibrary(Library), new Ranges(), read, parameters, signal);
  await assert.rejects(open, /not a \.reel stream/);
  assert.deepEqual(reads, [[0, 65536]]);
});

test("decoding a block needs only its bytes and those of its key block", async () => {
  const whole = streamBytes("key_blocks");
  const groups = groupsOf(whole);
  const original = await openEngine(internals, whole);
  const { info } = original;
  for (const number of groups.keys()) {
    // All bytes of other blocks are overwritten.
    const { start } = info.blocks[number];
    const decodeWithout = async (others) => {
      const bytes = whole.slice();
      groups.forEach(([[from, end]], i) => others.includes(i) && bytes.fill(0xff, from + 9, end));
      const engine = await openEngine(internals, bytes).catch(() => null);
      return engine?.frame(0, start, signal).catch(() => null);
    };
    const all = [...groups.keys()];
    const needed = [];
    for (const other of all) if (!(await decodeWithout([other]))) needed.push(other);
    assert.ok(needed.includes(number) && needed.length <= 2, `${number}: ${needed}`);
    const frame = await decodeWithout(all.filter((one) => !needed.includes(one)));
    assert.deepEqual(frame, await original.frame(0, start, signal));
  }
});

test("images are read on demand, and damage of one affects only it", async () => {
  const bytes = streamBytes("everything");
  const { images: expected, "hash of positions": hash } = expectedOf("everything");
  const [damaged, intact] = sectionsOf(bytes).filter(({ id }) => id === IMAGE);
  bytes[damaged.end - 5] ^= 1;
  const engine = await openEngine(internals, bytes);
  assert.equal(await framesHash(engine), hash);
  assert.equal(sha(await engine.image(1, signal)), expected[1].hash);
  await assert.rejects(engine.image(0, signal), {
    name: "CorruptStreamError",
    message: `a checksum does not match; fetch the file again (byte ${damaged.position})`,
  });
  assert.ok(intact.position > damaged.position);
});

test("memory is reused", async () => {
  const engine = await openEngine(internals, streamBytes("key_blocks"));
  const { heap, functions } = engine.library;
  const play = async () => {
    await framesHash(engine);
    for (const number of engine.info.blocks.keys()) await engine.fields(0, number, [0, 1, 2], signal);
  };
  await play();
  const sizes = [functions.memory.buffer.byteLength, heap.usedBytes];
  for (let turn = 0; turn < 10; turn++) await play();
  assert.deepEqual([functions.memory.buffer.byteLength, heap.usedBytes], sizes);
});

test("allocations of a heap do not overlap, and release makes all memory available", () => {
  const memory = new WebAssembly.Memory({ initial: 1 });
  const heap = new Heap(memory, 100);
  const allocations = new Map();
  let state = 1;
  const random = (n) => (state = (Math.imul(state, 48271) >>> 0) % 2147483647) % n;
  for (let turn = 0; turn < 3000; turn++) {
    if (allocations.size && random(2)) {
      const start = [...allocations.keys()][random(allocations.size)];
      heap.release(start, allocations.get(start));
      allocations.delete(start);
    } else {
      const size = random(5000);
      const start = heap.allocate(size);
      assert.ok(start % 64 === 0 && start >= 100 && start + size <= memory.buffer.byteLength);
      for (const [other, length] of allocations) {
        assert.ok(start + Math.max(size, 1) <= other || other + Math.max(length, 1) <= start);
      }
      allocations.set(start, size);
    }
  }
  for (const [start, size] of allocations) heap.release(start, size);
  assert.equal(heap.usedBytes, 0);
  const size = memory.buffer.byteLength - 128;
  assert.equal(heap.allocate(size), 128); // at the first address: the heap is empty
  assert.equal(memory.buffer.byteLength, size + 128);
  assert.equal(heap.allocate(2 ** 33), 0);
});

test("ranges report gaps and copy bytes", () => {
  const bytes = Uint8Array.from({ length: 100 }, (_, i) => i);
  const ranges = new Ranges([{ start: 10, bytes: bytes.slice(10, 20) }]);
  ranges.add(30, bytes.slice(30, 50));
  ranges.add(18, bytes.slice(18, 25));
  assert.deepEqual(ranges.missing(12, 40), [25, 30]);
  assert.deepEqual(ranges.missing(5, 12), [5, 10]);
  assert.deepEqual(ranges.missing(45, 60), [50, 60]);
  assert.equal(ranges.missing(12, 25), null);
  assert.equal(ranges.missing(60, 60), null);
  const into = new Uint8Array(10);
  assert.ok(ranges.copy(14, into));
  assert.deepEqual(into, bytes.slice(14, 24));
  assert.ok(!ranges.copy(20, into));
});
