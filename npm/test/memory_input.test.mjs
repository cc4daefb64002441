// Opening bytes in memory neither changes nor detaches them.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { describe, test } from "node:test";

import { ReelFile } from "../dist/index.js";
import { PACKAGE } from "./support/bundle.mjs";
import { PageWorker } from "./support/page_worker.mjs";
import { streamBytes, expectedOf, sha } from "./support/streams.mjs";

const NAME = "sphere";
const BYTES = streamBytes(NAME);

void Response; // Node initializes it in the memory that small Buffers share

/** Return a view into the middle of a larger buffer. */
function partOfLarger() {
  const larger = new Uint8Array(BYTES.length + 20).fill(7);
  larger.set(BYTES, 10);
  return larger.subarray(10, 10 + BYTES.length);
}

/** Return a Buffer from the pool that small Buffers share. */
function pooled() {
  const bytes = Buffer.from(BYTES);
  assert.notEqual(bytes.buffer.byteLength, bytes.length, "Node no longer pools small Buffers");
  return bytes;
}

/** Return a Buffer with its own memory. */
function unpooled() {
  return Buffer.from(BYTES.slice().buffer);
}

const INPUTS = {
  "a small Buffer with pooled memory": pooled,
  "a Buffer with its own memory": unpooled,
  "the result of readFile": () => readFile(join(PACKAGE, `../conformance/streams/${NAME}.reel`)),
  "a Uint8Array": () => BYTES.slice(),
  "a view into a larger buffer": partOfLarger,
  "an ArrayBuffer": () => BYTES.slice().buffer,
  "a Blob": () => new Blob([BYTES]),
};

async function assertOpens(from, options) {
  const reel = await ReelFile.open(from, options);
  try {
    assert.equal(reel.isInWorker, options.worker);
    const frames = [];
    for (let index = 0; index < reel.info.nFrames; index++) frames.push(await reel.frame(index));
    assert.equal(sha(...frames), expectedOf(NAME)["hash of positions"]);
  } finally {
    reel.close();
  }
}

/** Copy the whole memory of an input, including that outside of a view. */
async function memoryOf(from) {
  const buffer = from instanceof Blob ? await from.arrayBuffer() : (from.buffer ?? from);
  return Buffer.from(new Uint8Array(buffer));
}

for (const worker of [false, true]) {
  describe(worker ? "with a worker" : "without a worker", () => {
    for (const [what, input] of Object.entries(INPUTS)) {
      test(`${what} is unchanged after it was opened twice`, async (context) => {
        if (worker) {
          globalThis.Worker = PageWorker;
          context.after(() => delete globalThis.Worker);
        }
        const from = await input();
        const before = await memoryOf(from);
        await assertOpens(from, { worker });
        await assertOpens(from, { worker });
        assert.deepEqual(await memoryOf(from), before);
      });
    }
  });
}
