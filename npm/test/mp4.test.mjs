// Files in a box of an MP4 file, and damaged ones.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { ReelFile, SegmentedReelFile } from "../dist/index.js";
import { startServer } from "./server.mjs";
import { sha, streamBytes } from "./support/streams.mjs";

const REEL = Buffer.from("852cfece71bb4975bbc069f5c19c07a3", "hex");
const BYTES = streamBytes("sphere");
const FRAME = ReelFile.open(BYTES).then(async (file) => {
  const hash = sha(await file.frame(2));
  file.close();
  return hash;
});

/** A box; `size` replaces the true one, a BigInt is stored in 64 bits. */
function box(type, payload = [], size = payload.length + 8) {
  const isWide = typeof size === "bigint";
  const head = Buffer.alloc(isWide ? 16 : 8);
  head.writeUInt32BE(isWide ? 1 : size);
  head.write(type, 4, "latin1");
  if (isWide) head.writeBigUInt64BE(size, 8);
  return Buffer.concat([head, Buffer.from(payload)]);
}

const mp4 = (...boxes) => Buffer.concat([box("ftyp", Buffer.alloc(8)), box("mdat", Buffer.alloc(200_000)), ...boxes]);
const reel = Buffer.concat([REEL, BYTES]);
const FILE = mp4(box("uuid", reel));

let server;
before(async () => (server = await startServer(FILE)));
after(() => server.close());

async function assertDecodes(source) {
  const file = await SegmentedReelFile.open(source);
  try {
    assert.equal(file.isInMp4, true);
    assert.equal(sha((await file.frame(2)).positions), await FRAME);
  } finally {
    file.close();
  }
}

for (const [what, source] of [
  ["at the end", () => FILE],
  ["with a size of 64 bits, before others", () => mp4(box("uuid", reel, BigInt(reel.length + 16)), box("free"))],
  ["without a size, after another uuid", () => mp4(box("uuid", Buffer.alloc(16)), box("uuid", reel, 0))],
  ["on a server without ranges", () => server.address({ ranges: "no" })],
  ["on a server without ranges and size", () => server.address({ ranges: "no", chunked: "yes" })],
]) {
  test(`a file in a box of an MP4 file is decoded: ${what}`, () => assertDecodes(source()));
}

test("of a remote MP4 file only the needed ranges are requested", async () => {
  const address = server.address();
  await assertDecodes(address);
  assert.ok(server.bytesSentTo(address) < 100_000 + BYTES.length, `${server.requestsOf(address)}`);
});

for (const [what, file, message] of [
  ["no .reel", mp4(), /contains no \.reel; `meshreel register/],
  ["too many boxes", mp4(...Array(99).fill(box("free"))), /contains no \.reel/],
  ["a box of 4 bytes", mp4(box("free", [], 4)), /a box at byte 200024 of the MP4 file exceeds it/],
  ["a box beyond the end", mp4(box("free", [], 2 ** 31)), /exceeds it; fetch the file again/],
  ["a huge box", mp4(box("free", [], 2n ** 64n - 1n)), /exceeds it/],
  ["a box of 0 bytes in 64 bits", mp4(box("free", [], 0n)), /exceeds it/],
  ["a box to the end", mp4(box("free", [], 0), FILE), /contains no \.reel/],
  ["an empty .reel", mp4(box("uuid", REEL)), /the file ends inside its header/],
]) {
  test(`an MP4 file with ${what} is an error`, async () => {
    await assert.rejects(ReelFile.open(file), (error) => message.test(error.message) && /Stream/.test(error.name));
  });
}
