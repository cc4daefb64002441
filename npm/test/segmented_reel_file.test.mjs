// Files with several segments: frames across segments, bytes that are read, and damage.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";

import { InvalidInputError, ReelFile, SegmentedReelFile } from "../dist/index.js";
import { loadInternals, openSegments } from "./support/bundle.mjs";
import { END, FRAMES_AT, SEGMENT, sealHeader, sectionBytes, sectionsOf } from "./support/container.mjs";
import { expectedSegments, integerHash, segmentedBytes, sha, streamBytes } from "./support/streams.mjs";
import { largeSegments } from "./support/track_streams.mjs";

const { signal } = new AbortController();

/** Call `work` with an open file, and close it. */
async function withFile(from, work, options) {
  const file = await SegmentedReelFile.open(from, options);
  try {
    return await work(file);
  } finally {
    file.close();
  }
}

/** First frame of each segment. */
function startsOf(segments) {
  let start = 0;
  return segments.map(({ frames }) => (start += frames) - frames);
}

test("frames of all segments are bit-exact", async () => {
  const meshes = ["two_meshes", "two_meshes_no_index", "one_frame_each", "placed_alike"];
  for (const name of [...meshes, "returning", "returning_no_index", "one_look"]) {
    const expected = expectedSegments(name);
    await withFile(segmentedBytes(name), async (file) => {
      assert.deepEqual(
        file.segments.map(({ start, nFrames, nVerts, nFaces }) => [start, nFrames, nVerts, nFaces]),
        expected.map((one, i) => [startsOf(expected)[i], one.frames, one.vertices, one.faces]),
      );
      const { nFrames } = file.info;
      assert.equal(nFrames, expected.reduce((sum, { frames }) => sum + frames, 0));
      const positions = expected.map(() => []);
      for (let t = 0; t < nFrames; t++) {
        const frame = await file.frame(t);
        positions[frame.segment].push(frame.positions);
        assert.equal(integerHash(frame.triangles), expected[frame.segment]["hash of faces"], name);
      }
      positions.forEach((frames, i) => {
        assert.equal(sha(...frames), expected[i]["hash of positions"], `${name} ${i}`);
      });
    });
  }
});

test("the damage of a file without its end is reported", async () => {
  const whole = segmentedBytes("two_meshes");
  await withFile(whole, (file) => assert.equal(file.info.damage, null));
  await withFile(whole.slice(0, -1), (file) => assert.match(file.info.damage, /^the file ends/));
});

test("segments that were closed are opened again", async () => {
  const expected = expectedSegments("one_frame_each");
  await withFile(segmentedBytes("one_frame_each"), async (file) => {
    const reels = [];
    for (const index of expected.keys()) reels.push(await file.segment(index));
    assert.ok(expected.length > 4, "the worker keeps 4 segments open");
    for (const [index, reel] of reels.entries()) {
      assert.equal(sha(await reel.frame(0)), expected[index]["hash of positions"]);
      const again = await file.segment(index);
      assert.equal(integerHash(again.surface.triangles), expected[index]["hash of faces"]);
    }
  });
});

test("tracks of a segment are decoded", async () => {
  await withFile(segmentedBytes("two_meshes"), async (file) => {
    const reel = await file.segment(1);
    assert.deepEqual(file.first.info.tracks, []);
    const frames = [];
    for (let t = 0; t < reel.info.nFrames; t++) frames.push(await reel.track("heat").frame(t));
    assert.equal(sha(...frames), expectedSegments("two_meshes")[1].tracks[0]["hash of values"]);
    const fields = await reel.fields(0);
    assert.deepEqual([fields.start, fields.nFrames, fields.nVerts], [0, 4, 8]);
  });
});

test("a file with one segment is opened like any other", async () => {
  const reel = await ReelFile.open(streamBytes("geometry"));
  await withFile(streamBytes("geometry"), async (file) => {
    assert.equal(file.segments.length, 1);
    assert.deepEqual(file.first.info, reel.info);
    const { segment, positions } = await file.frame(1);
    assert.deepEqual([segment, positions], [0, await reel.frame(1)]);
  });
  reel.close();
});

test("segments and frames that do not exist are rejected", async () => {
  await withFile(segmentedBytes("two_meshes"), async (file) => {
    await assert.rejects(file.segment(2), { name: "InvalidInputError", message: /0 to 1; got 2/ });
    await assert.rejects(file.frame(9), { name: "InvalidInputError", message: /0 to 8; got 9/ });
    await assert.rejects(file.frame(-1), InvalidInputError);
  });
});

/** A blob, and the ranges that are read from it. */
function recordedBlob(bytes) {
  const ranges = [];
  const blob = new Blob([bytes]);
  const slice = blob.slice.bind(blob);
  blob.slice = (start, end) => {
    ranges.push([start, end]);
    return slice(start, end);
  };
  return { blob, ranges };
}

test("a mesh of an earlier segment is read by one more request", async () => {
  const { blob, ranges } = recordedBlob(largeSegments("returning"));
  const expected = expectedSegments("returning");
  await withFile(blob, async (file) => {
    ranges.length = 0;
    const reel = await file.segment(5);
    assert.equal(ranges.length, 2, String(ranges));
    assert.ok(ranges[1][0] > 100_000 && ranges[1][1] < 200_000, String(ranges)); // in segment 1
    assert.equal(integerHash(reel.surface.triangles), expected[5]["hash of faces"]);
    assert.deepEqual(reel.surface.attributes.map(({ name }) => name), ["uv"]);
    assert.equal(reel.surface.images.length, expected[5].images.length);
    assert.equal(sha(await reel.frame(0)), expected[5]["hash of positions"]);
  });
});

test("a segment is found by the index and read by one request", async () => {
  const { blob, ranges } = recordedBlob(largeSegments("one_frame_each"));
  await withFile(blob, async (file) => {
    const expected = expectedSegments("one_frame_each");
    ranges.length = 0;
    const reel = await file.segment(1);
    const { sizeBytes } = file.segments[1];
    assert.ok(sizeBytes > 100_000);
    assert.equal(ranges.length, 1, String(ranges));
    assert.equal(ranges[0][1] - ranges[0][0], 65536);
    await reel.frame(0);
    assert.ok(ranges.every(([start, end]) => end - start < sizeBytes), String(ranges));
    assert.equal(sha(await reel.frame(0)), expected[1]["hash of positions"]);
  });
});

/** The stream "one_frame_each" with its last segment `count` times more; no index. */
function repeated(count, isWhole = true) {
  const bytes = segmentedBytes("one_frame_each");
  const sections = sectionsOf(bytes);
  const last = sections.filter(({ id }) => id === SEGMENT).at(-1).position;
  const index = sections.at(-2).position;
  const copies = Array.from({ length: count }, () => bytes.subarray(last, index));
  const end = isWhole ? [sectionBytes(END, [])] : [];
  const joined = Buffer.concat([bytes.subarray(0, index), ...copies, ...end]);
  joined[FRAMES_AT] = 0; // the number of frames is not stated
  sealHeader(joined);
  return new Uint8Array(joined);
}

test("files of very many segments are opened and played", async () => {
  const count = 20_000;
  const expected = expectedSegments("one_frame_each").at(-1);
  await withFile(repeated(count), async (file) => {
    assert.equal(file.segments.length, count + 5);
    for (const index of [count + 4, 5, 10_000]) {
      const { segment, positions } = await file.frame(index);
      assert.equal(segment, index);
      assert.equal(sha(positions), expected["hash of positions"]);
    }
  });
  await withFile(repeated(count, false).subarray(0, -1), async (file) => {
    assert.equal(file.segments.length, count + 4);
  });
});

/** Refused streams whose first segments are complete, and end there without a usable index. */
const CUT_WHERE_DAMAGED = [
  "no_block", "no_block_of_the_last", "no_tracks", "reference_without_index",
];

test("files that break a rule of segments play up to there or throw", async () => {
  const folder = new URL("../../conformance/segments/refused/", import.meta.url);
  const played = [];
  for (const name of readdirSync(folder)) {
    const play = async (file) => {
      for (let t = 0; t < file.info.nFrames; t++) await file.frame(t);
      played.push(name);
    };
    await withFile(new Uint8Array(readFileSync(new URL(name, folder))), play).catch((error) => {
      assert.match(error.name, /^(CorruptStream|TruncatedStream)Error$/, name);
    });
  }
  assert.deepEqual(played.sort(), CUT_WHERE_DAMAGED.map((name) => `${name}.reel`));
});

test("damage of a segment leaves the others intact", async () => {
  const bytes = segmentedBytes("one_frame_each");
  const expected = expectedSegments("one_frame_each");
  const [first, second] = sectionsOf(bytes).filter(({ id }) => id === SEGMENT);
  bytes.fill(0xff, first.end, second.position);
  await withFile(bytes, async (file) => {
    await assert.rejects(file.frame(1), { name: "CorruptStreamError" });
    assert.equal(sha((await file.frame(3)).positions), expected[3]["hash of positions"]);
  });
});

test("segments that are not used last release their memory", async () => {
  const internals = await loadInternals();
  const { file, engine } = await openSegments(internals, segmentedBytes("one_frame_each"), {
    segment: 0,
  });
  const { heap } = engine.library;
  const play = async () => {
    for (let index = 0; index < file.segments.length; index++) {
      await (await file.segment(index, signal)).frame(0, 0, signal);
    }
    return heap.usedBytes;
  };
  await play();
  const sizes = [await play(), await play(), await play()];
  assert.equal(new Set(sizes).size, 1, String(sizes));
});
