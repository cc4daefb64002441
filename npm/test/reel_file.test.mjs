// An open file: bytes are read on demand, and errors have the right class.

import assert from "node:assert/strict";
import { test } from "node:test";

import {
  CorruptStreamError,
  InvalidInputError,
  ReelFile,
  TruncatedStreamError,
  UnsupportedVersionError,
} from "../dist/index.js";
import { OTHERS, PLAYED, streamBytes, expectedOf, sha } from "./support/streams.mjs";
import { largeTracks } from "./support/track_streams.mjs";

/** Call `work` with an open file, and close it. */
async function withReel(from, work, options) {
  const reel = await ReelFile.open(from, options);
  try {
    return await work(reel);
  } finally {
    reel.close();
  }
}

async function decodeFrames(reel, indices) {
  const frames = [];
  for (const index of indices) frames.push(await reel.frame(index));
  return frames;
}

const range = (n) => Array.from({ length: n }, (_, i) => i);

test("positions of every stream are bit-exact", async () => {
  for (const name of PLAYED) {
    await withReel(streamBytes(name), async (reel) => {
      const frames = await decodeFrames(reel, range(reel.info.nFrames));
      assert.equal(sha(...frames), expectedOf(name)["hash of positions"], name);
    });
  }
});

test("frames do not depend on the order of requests", async () => {
  await withReel(streamBytes("key_blocks"), async (reel) => {
    const { nFrames, blocks } = reel.info;
    assert.ok(blocks.length > 2);
    const frames = await decodeFrames(reel, range(nFrames));
    const backwards = await decodeFrames(reel, range(nFrames).reverse());
    assert.equal(sha(...backwards.reverse()), sha(...frames));
  });
});

/** A blob that records the positions of reads. */
function recordingBlob(bytes) {
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

test("the next block is prefetched only in the second half of a block that is played in order", async () => {
  const { blob, starts } = recordingBlob(largeTracks(100_000));
  await withReel(blob, async (reel) => {
    const { blocks } = reel.info;
    starts.length = 0;
    const half = Math.ceil(blocks[0].nFrames / 2);
    for (let number = 0; number < half; number++) await reel.frame(number);
    await tick();
    assert.equal(starts.length, 1, "a block was read too early");
    for (let number = half; number < blocks[0].nFrames; number++) await reel.frame(number);
    await tick();
    assert.equal(starts.length, 2, "the next block was not prefetched");
    await reel.frame(blocks[1].start);
    assert.equal(starts.length, 2, "the next block was read again");
  });
});

test("invalid frames and blocks are rejected", async () => {
  await withReel(streamBytes("sphere"), async (reel) => {
    const { nFrames, blocks } = reel.info;
    for (const number of [-1, nFrames, 0.5, NaN]) {
      await assert.rejects(reel.frame(number), InvalidInputError);
    }
    await assert.rejects(reel.fields(blocks.length), InvalidInputError);
  });
});

test("images are read once, by index", async () => {
  await withReel(streamBytes("everything"), async (reel) => {
    const hashes = expectedOf("everything").images.map(({ hash }) => hash);
    const images = await Promise.all(hashes.map((_, index) => reel.image(index)));
    assert.deepEqual(images.map((bytes) => sha(bytes)), hashes);
    assert.equal(await reel.image(1), images[1]);
    for (const index of [-1, hashes.length, 0.5]) await assert.rejects(reel.image(index), InvalidInputError);
  });
});

test("fields and weights yield positions within 1e-5 of the diagonal", async () => {
  for (const name of ["sphere", "corrections", "max_error_in_blocks"]) {
    await withReel(streamBytes(name), async (reel) => {
      const { blocks, center, diagonal, nVerts } = reel.info;
      for (const number of blocks.keys()) {
        const block = await reel.fields(number);
        for (let t = 0; t < block.nFrames; t++) {
          const expected = await reel.frame(block.start + t);
          const sums = new Float64Array(3 * nVerts).map((_, i) => center[i % 3]);
          for (let k = 0; k < block.nModes; k++) {
            for (let i = 0; i < 3 * nVerts; i++) {
              const weight = block.weights[(t * block.nModes + k) * 3 + (i % 3)];
              sums[i] += weight * block.fields[k * nVerts + Math.floor(i / 3)];
            }
          }
          for (let i = block.correctionStarts[t]; i < block.correctionStarts[t + 1]; i++) {
            for (let axis = 0; axis < 3; axis++) {
              const at = 3 * block.correctionVertices[i] + axis;
              sums[at] += block.correctionOffsets[3 * i + axis];
            }
          }
          for (let i = 0; i < expected.length; i++) {
            const rounding = 2 ** -23 * Math.abs(expected[i]); // float32 rounding of the frame
            const error = Math.abs(sums[i] - expected[i]) - rounding;
            assert.ok(error < 1e-5 * diagonal, `${name}: ${error / diagonal}`);
          }
        }
      }
    });
  }
});

test("a canceled call throws the reason, and later calls work", async () => {
  await withReel(streamBytes("sphere"), async (reel) => {
    const aborting = new AbortController();
    const first = reel.frame(0, null, { signal: aborting.signal });
    aborting.abort();
    await assert.rejects(first, { name: "AbortError" });
    await assert.rejects(reel.frame(0, null, { signal: aborting.signal }), {
      name: "AbortError",
    });
    assert.equal((await reel.frame(0)).length, 3 * reel.info.nVerts);
  });
});

test("calls on a closed file throw", async () => {
  const reel = await ReelFile.open(streamBytes("sphere"));
  const pending = reel.frame(0);
  reel.close();
  await assert.rejects(pending, { name: "AbortError" });
  await assert.rejects(reel.frame(0), { name: "AbortError" });
});

test("a damaged block is an error, and others are decoded", async () => {
  const bytes = Uint8Array.from(streamBytes("blocks"));
  const whole = await withReel(bytes, (reel) => decodeFrames(reel, range(reel.info.nFrames)));
  const sizes = await withReel(bytes, (reel) => reel.info.blocks.map((block) => block.sizeBytes));
  assert.ok(sizes.length > 2);
  // The last block ends where the index begins, which the end marker contains.
  const end = Number(new DataView(bytes.buffer).getBigUint64(bytes.length - 12, true));
  bytes[end - Math.floor(sizes[sizes.length - 1] / 2)] ^= 0x20;
  await withReel(bytes, async (reel) => {
    const { blocks, nFrames } = reel.info;
    await assert.rejects(reel.frame(nFrames - 1), CorruptStreamError);
    const intact = blocks[blocks.length - 1].start;
    assert.equal(sha(...(await decodeFrames(reel, range(intact)))), sha(...whole.slice(0, intact)));
  });
});

test("other formats, truncated files and other methods have their error class", async () => {
  const bytes = streamBytes("sphere");
  await assert.rejects(ReelFile.open(new Uint8Array(200)), CorruptStreamError);
  await assert.rejects(ReelFile.open(bytes.subarray(0, 40)), TruncatedStreamError);
  for (const name of OTHERS) {
    await assert.rejects(ReelFile.open(streamBytes(name)), UnsupportedVersionError);
  }
  await assert.rejects(ReelFile.open(17), InvalidInputError);
});
