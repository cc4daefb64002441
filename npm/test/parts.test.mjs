// A stream is read from parts of its file, as ranges or downloads give them.

import assert from "node:assert/strict";
import { test } from "node:test";
import { loadInternals, newCore } from "./support/bundle.mjs";
import { REELS, bytesOf } from "./support/streams.mjs";

const {
  BlockDecoder,
  Core,
  END_SIZE_BYTES,
  Heap,
  Items,
  LONGEST_HEADER,
  MemoryReel,
  Scan,
  SourceError,
  checkedStream,
  decodeConnectivity,
  firstBlock,
  frameOf,
  indexPayload,
  indexPosition,
  nTracks,
  readBlock,
  readHeader,
  readIndex,
  readSections,
  readStream,
} = await loadInternals();

const INDEXED = REELS.filter((name) => name !== "no_index" && !name.startsWith("live"));

/** Reads a stream from stretches that are asked for one by one, of a file that is otherwise gone. */
function openInParts(file) {
  const read = (start, end) => ({ bytes: file.slice(start, end), start });
  const header = readHeader(read(0, LONGEST_HEADER).bytes);
  const tail = read(file.length - END_SIZE_BYTES, file.length);
  const position = indexPosition(tail, header.sizeBytes, file.length);
  const index = indexPayload(read(position, file.length), position, header.sizeBytes, file.length);
  const first = firstBlock(index);
  const leading = readSections(read(header.sizeBytes, first), header.sizeBytes, first);
  const places = readIndex(index, position, nTracks(leading));
  return checkedStream(header, leading, places, file.length, true);
}

test("a stream in parts is the stream", () => {
  for (const name of INDEXED) {
    const file = bytesOf(name);
    const whole = readStream(file);
    const stream = openInParts(file);
    assert.deepEqual(stream.places, whole.places, name);
    assert.deepEqual(stream.starts, whole.starts);
    assert.deepEqual(
      stream.leading.map((section) => section.id),
      whole.leading.map((section) => section.id),
    );
  }
});

test("a block is decoded from its bytes and those of its key block alone", async () => {
  const file = bytesOf("key_blocks");
  const stream = openInParts(file);
  const reel = new MemoryReel(newCore(Core), file);
  let nKeys = 0;
  const stored = (number) => {
    const place = stream.places[number];
    const bytes = file.slice(place.position, place.position + place.sizes[0]);
    return readBlock(bytes, place, number, stream.starts[number]);
  };
  for (const number of stream.places.keys()) {
    const core = newCore(Core); // of a worker that has seen no other block
    const mesh = new Items(core, decodeConnectivity(core, stream.header, stream.leading));
    const decoder = new BlockDecoder(mesh, 3);
    const { reference } = stored(number).layout;
    const asked = [];
    const decode = await decoder.prepare(stored(number), async (key) => {
      asked.push(key);
      return stored(key);
    });
    const block = decode();
    assert.deepEqual(asked, reference ? [number - reference] : []);
    nKeys += asked.length;
    await decoder.prepare(stored(number), () => assert.fail("the key block is kept"));
    const wanted = reel.decodeBlock(number);
    for (let t = 0; t < block.nFrames; t++) {
      assert.deepEqual(frameOf(core, stream.header, block, t), reel.frameOf(wanted, t));
    }
    wanted.close();
  }
  assert.ok(nKeys > 0);
});

test("blocks are found as a file comes in", () => {
  for (const name of ["key_blocks", "no_index", "live", "tracks"].filter((one) =>
    REELS.includes(one),
  )) {
    const file = bytesOf(name);
    const wanted = readStream(file);
    const scan = new Scan(wanted.header.sizeBytes);
    let last = 0;
    for (let length = scan.position; length <= file.length; length += 7) {
      scan.advance(file.subarray(0, length), false);
      assert.ok(scan.places.length >= last && !scan.damage);
      last = scan.places.length;
      assert.ok(scan.position <= length);
    }
    scan.advance(file, true);
    assert.ok(scan.isDone && !scan.damage);
    assert.deepEqual(scan.places, wanted.places, name);
  }
});

test("a section that has not come whole is said to be missing", () => {
  const file = bytesOf("geometry");
  const { sizeBytes } = readHeader(file);
  const stretch = { bytes: file.slice(0, sizeBytes + 20), start: 0 };
  assert.throws(() => readSections(stretch, sizeBytes, file.length), SourceError);
});

test("memory is used again", () => {
  const core = newCore(Core);
  const reel = new MemoryReel(core, bytesOf("key_blocks"));
  const play = () => {
    for (const number of reel.info.blocks.keys()) {
      const block = reel.decodeBlock(number);
      for (let t = 0; t < block.nFrames; t++) reel.frameOf(block, t);
      reel.fieldsOf(block);
      block.close();
    }
  };
  play();
  const [sizeBytes, usedBytes] = [core.functions.memory.buffer.byteLength, core.heap.usedBytes];
  for (let turn = 0; turn < 20; turn++) play();
  assert.equal(core.functions.memory.buffer.byteLength, sizeBytes);
  assert.equal(core.heap.usedBytes, usedBytes);
});

test("parts of a heap do not overlap, and all of it is free in the end", () => {
  const memory = new WebAssembly.Memory({ initial: 1 });
  const heap = new Heap(memory, 100);
  const parts = new Map();
  let state = 1;
  const random = (n) => (state = (Math.imul(state, 48271) >>> 0) % 2147483647) % n;
  for (let turn = 0; turn < 3000; turn++) {
    if (parts.size && random(2)) {
      const start = [...parts.keys()][random(parts.size)];
      if (random(4)) {
        heap.give(start);
        parts.delete(start);
      } else {
        parts.set(start, Math.ceil(parts.get(start) / 2));
        heap.shrink(start, parts.get(start));
      }
    } else {
      const size = random(5000);
      const start = heap.take(size);
      assert.ok(start % 64 === 0 && start >= 100 && start + size <= memory.buffer.byteLength);
      for (const [other, length] of parts) {
        assert.ok(start + Math.max(size, 1) <= other || other + Math.max(length, 1) <= start);
      }
      parts.set(start, size);
    }
  }
  for (const start of parts.keys()) heap.give(start);
  assert.equal(heap.usedBytes, 0);
  const size = memory.buffer.byteLength - 128;
  assert.equal(heap.take(size), 128); // where the first part was: nothing is in between
  assert.equal(memory.buffer.byteLength, size + 128);
});
