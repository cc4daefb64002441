// A file that is open: bytes are read as they are needed, and what goes wrong has its type.

import assert from "node:assert/strict";
import { test } from "node:test";

import {
  CorruptStreamError,
  InvalidInputError,
  ReelFile,
  TruncatedStreamError,
  UnsupportedVersionError,
} from "../dist/index.js";
import { OTHERS, PLAYED, bytesOf, said, sha } from "./support/streams.mjs";
import { largeTracks } from "./support/track_streams.mjs";

/** Runs `work` with an open file, which is closed in any case. */
async function withReel(from, work, options) {
  const reel = await ReelFile.open(from, options);
  try {
    return await work(reel);
  } finally {
    reel.close();
  }
}

async function framesOf(reel, numbers) {
  const found = [];
  for (const number of numbers) found.push(await reel.frame(number));
  return found;
}

const counted = (n) => Array.from({ length: n }, (_, i) => i);

test("positions of every stream are the same bits through a file", async () => {
  for (const name of PLAYED) {
    await withReel(bytesOf(name), async (reel) => {
      const frames = await framesOf(reel, counted(reel.info.nFrames));
      assert.equal(sha(...frames), said(name)["hash of positions"], name);
    });
  }
});

test("frames are the same in any order, though two blocks are kept", async () => {
  await withReel(bytesOf("key_blocks"), async (reel) => {
    const { nFrames, blocks } = reel.info;
    assert.ok(blocks.length > 2);
    const frames = await framesOf(reel, counted(nFrames));
    const backwards = await framesOf(reel, counted(nFrames).reverse());
    assert.equal(sha(...backwards.reverse()), sha(...frames));
  });
});

/** A blob that notes where it is read. */
function notedBlob(bytes) {
  const blob = new Blob([bytes]);
  const starts = [];
  const slice = blob.slice.bind(blob);
  blob.slice = (start, end) => {
    starts.push(start);
    return slice(start, end);
  };
  return { blob, starts };
}

const tick = () => new Promise((resolve) => setTimeout(resolve, 100));

test("the next block is read when frames are asked for in order, and not before", async () => {
  const { blob, starts } = notedBlob(largeTracks(100_000));
  await withReel(blob, async (reel) => {
    const { blocks } = reel.info;
    starts.length = 0;
    const half = Math.ceil(blocks[0].nFrames / 2);
    for (let number = 0; number < half; number++) await reel.frame(number);
    await tick();
    assert.equal(starts.length, 1, "a block that is not near was read");
    for (let number = half; number < blocks[0].nFrames; number++) await reel.frame(number);
    await tick();
    assert.equal(starts.length, 2, "the next block was not read ahead");
    await reel.frame(blocks[1].start);
    assert.equal(starts.length, 2, "the next block was read again");
  });
});

test("a frame comes into what is given, if that fits", async () => {
  await withReel(bytesOf("sphere"), async (reel) => {
    const into = new Float32Array(3 * reel.info.nVerts);
    assert.equal(await reel.frame(0, into), into);
    assert.deepEqual(into, await reel.frame(0));
    await assert.rejects(reel.frame(0, new Float32Array(3)), InvalidInputError);
    await assert.rejects(reel.frame(0, new Float64Array(into.length)), InvalidInputError);
  });
});

test("frames and blocks that are not there are refused", async () => {
  await withReel(bytesOf("sphere"), async (reel) => {
    const { nFrames, blocks } = reel.info;
    for (const number of [-1, nFrames, 0.5, NaN]) {
      await assert.rejects(reel.frame(number), InvalidInputError);
    }
    await assert.rejects(reel.fields(blocks.length), InvalidInputError);
  });
});

test("fields and weights make positions within 1e-5 of the diagonal", async () => {
  for (const name of ["sphere", "corrections", "max_error_in_blocks"]) {
    await withReel(bytesOf(name), async (reel) => {
      const { blocks, center, diagonal, nVerts } = reel.info;
      for (const number of blocks.keys()) {
        const block = await reel.fields(number);
        for (let t = 0; t < block.nFrames; t++) {
          const wanted = await reel.frame(block.start + t);
          const found = new Float64Array(3 * nVerts).map((_, i) => center[i % 3]);
          for (let k = 0; k < block.nModes; k++) {
            for (let i = 0; i < 3 * nVerts; i++) {
              const weight = block.weights[(t * block.nModes + k) * 3 + (i % 3)];
              found[i] += weight * block.fields[k * nVerts + Math.floor(i / 3)];
            }
          }
          for (let i = block.correctionStarts[t]; i < block.correctionStarts[t + 1]; i++) {
            for (let axis = 0; axis < 3; axis++) {
              const at = 3 * block.correctionVertices[i] + axis;
              found[at] += block.correctionOffsets[3 * i + axis];
            }
          }
          for (let i = 0; i < wanted.length; i++) {
            const rounding = 2 ** -23 * Math.abs(wanted[i]); // of the frame, which may be far away
            const error = Math.abs(found[i] - wanted[i]) - rounding;
            assert.ok(error < 1e-5 * diagonal, `${name}: ${error / diagonal}`);
          }
        }
      }
    });
  }
});

test("a question that is taken back throws the reason, and the next is answered", async () => {
  await withReel(bytesOf("sphere"), async (reel) => {
    const aborting = new AbortController();
    const first = reel.frame(0, undefined, { signal: aborting.signal });
    aborting.abort();
    await assert.rejects(first, { name: "AbortError" });
    await assert.rejects(reel.frame(0, undefined, { signal: aborting.signal }), {
      name: "AbortError",
    });
    assert.equal((await reel.frame(0)).length, 3 * reel.info.nVerts);
  });
});

test("a file that is closed answers nothing more", async () => {
  const reel = await ReelFile.open(bytesOf("sphere"));
  const waiting = reel.frame(0);
  reel.close();
  await assert.rejects(waiting, { name: "AbortError" });
  await assert.rejects(reel.frame(0), { name: "AbortError" });
});

test("a damaged block is told, and others are decoded", async () => {
  const bytes = Uint8Array.from(bytesOf("blocks"));
  const whole = await withReel(bytes, (reel) => framesOf(reel, counted(reel.info.nFrames)));
  const sizes = await withReel(bytes, (reel) => reel.info.blocks.map((one) => one.sizeBytes));
  assert.ok(sizes.length > 2);
  // The last block ends where the index begins, which the end says.
  const end = Number(new DataView(bytes.buffer).getBigUint64(bytes.length - 12, true));
  bytes[end - Math.floor(sizes[sizes.length - 1] / 2)] ^= 0x20;
  await withReel(bytes, async (reel) => {
    const { blocks, nFrames } = reel.info;
    await assert.rejects(reel.frame(nFrames - 1), CorruptStreamError);
    const intact = blocks[blocks.length - 1].start;
    assert.equal(sha(...(await framesOf(reel, counted(intact)))), sha(...whole.slice(0, intact)));
  });
});

test("what is no file, is cut off or of other methods has its type", async () => {
  const bytes = bytesOf("sphere");
  await assert.rejects(ReelFile.open(new Uint8Array(200)), CorruptStreamError);
  await assert.rejects(ReelFile.open(bytes.subarray(0, 40)), TruncatedStreamError);
  for (const name of OTHERS) {
    await assert.rejects(ReelFile.open(bytesOf(name)), UnsupportedVersionError);
  }
  await assert.rejects(ReelFile.open(17), InvalidInputError);
});
