// Tracks are bit-identical to Python, and only requested tracks are read.

import assert from "node:assert/strict";
import { test } from "node:test";

import {
  CorruptStreamError,
  InvalidInputError,
  ReelFile,
  TruncatedStreamError,
  UnsupportedVersionError,
} from "../dist/index.js";
import { groupsOf } from "./support/container.mjs";
import { PLAYED, streamBytes, expectedOf, sha } from "./support/streams.mjs";
import {
  largeTracks,
  withExactTrack,
  withMissingValues,
  withTrack,
} from "./support/track_streams.mjs";

const { signal } = new AbortController();
const WITH_TRACKS = PLAYED.filter((name) => expectedOf(name).tracks);

async function withReel(from, work, options) {
  const reel = await ReelFile.open(from, options);
  try {
    return await work(reel);
  } finally {
    reel.close();
  }
}

/** Decode all frames of a track, or of the positions if `track` is the file. */
async function decodeAll(reel, track) {
  const frames = [];
  for (let index = 0; index < reel.info.nFrames; index++) frames.push(await track.frame(index));
  return frames;
}

/** A blob that records the ranges of reads. */
function recordingBlob(bytes) {
  const blob = new Blob([bytes]);
  const reads = [];
  const slice = blob.slice.bind(blob);
  blob.slice = (start, end) => {
    reads.push([start, end]);
    return slice(start, end);
  };
  return { blob, reads };
}

test("values of every track are bit-identical to Python", async () => {
  for (const name of WITH_TRACKS) {
    await withReel(streamBytes(name), async (reel) => {
      for (const { name: track, "hash of values": hash } of expectedOf(name).tracks) {
        assert.equal(sha(...(await decodeAll(reel, reel.track(track)))), hash, `${name}: ${track}`);
      }
    });
  }
});

const ARRAYS = {
  float32: Float32Array,
  float64: Float64Array,
  uint8: Uint8Array,
  uint32: Uint32Array,
  int16: Int16Array,
  int32: Int32Array,
  int64: BigInt64Array,
};

test("metadata of a track matches the shape and type of its values", async () => {
  const types = new Set();
  let nMissing = 0;
  for (const name of WITH_TRACKS) {
    await withReel(streamBytes(name), async (reel) => {
      for (const info of reel.info.tracks) {
        const values = await reel.track(info.name).frame(0);
        assert.equal(values.length, info.nItems * info.nColumns);
        assert.equal(values.constructor, ARRAYS[info.numberType], `${name}: ${info.numberType}`);
        types.add(info.numberType);
        if (!info.isExact) nMissing += values.filter(Number.isNaN).length;
      }
    });
  }
  assert.deepEqual([...types].sort(), Object.keys(ARRAYS).sort());
  assert.ok(nMissing > 0);
  await withReel(streamBytes("tracks"), ({ info }) => {
    assert.deepEqual(info.tracks[1], {
      name: "flow",
      unit: "m/s",
      kind: "vector",
      domain: "vertex",
      nColumns: 2,
      nItems: 42,
      numberType: "float64",
      isExact: false,
      errorBound: null,
      sizeBytes: groupsOf(streamBytes("tracks")).reduce((sum, [, , [start, end]]) => sum + end - start, 0),
    });
  });
});

test("frames of a track do not depend on the order", async () => {
  await withReel(streamBytes("tracks"), async (reel) => {
    const stress = reel.track("stress");
    const forwards = await decodeAll(reel, stress);
    for (let number = reel.info.nFrames - 1; number >= 0; number--) {
      assert.deepEqual(await stress.frame(number), forwards[number]);
    }
    await assert.rejects(stress.frame(14), /frame must be an integer from 0 to 13; got 14/);
    await assert.rejects(stress.fields(3), InvalidInputError);
  });
});

test("the error for an unknown track lists the available ones", async () => {
  await withReel(streamBytes("tracks"), (reel) => {
    assert.throws(() => reel.track("strain"), {
      name: "InvalidInputError",
      message: 'there is no track "strain"; available: "stress", "flow", "σ"',
    });
  });
  await withReel(streamBytes("sphere"), (reel) => {
    assert.throws(() => reel.track("stress"), /available: none/);
  });
});

test("only bytes of the requested track are read, block by block", async () => {
  const bytes = largeTracks(30_000);
  const groups = groupsOf(bytes);
  assert.ok(bytes.length > 2 * 65536 && groups.length > 2);
  const { blob, reads } = recordingBlob(bytes);
  const groupOf = (block, track) => groups[block][track];
  await withReel(blob, async (reel) => {
    reads.length = 0;
    await reel.frame(reel.info.blocks[2].start);
    assert.deepEqual(reads, [groupOf(2, 0)]);
    reads.length = 0;
    const flow = reel.track("flow");
    await flow.frame(reel.info.blocks[2].start);
    assert.deepEqual(reads, [groupOf(2, 2)]);
    await flow.frame(reel.info.blocks[2].start + 1);
    assert.equal(reads.length, 1, "a block was read again");
    await flow.frame(reel.info.blocks[1].start);
    // Its key block begins before byte 65536; those bytes were read when the file was opened.
    assert.deepEqual(reads.slice(1), [groupOf(1, 2), [65536, groupOf(0, 2)[1]]]);
  });
});

test("fields and weights yield values within 1e-5 of the scale", async () => {
  for (const [name, scales] of [
    ["tracks", [3e5, 0.125, 1]],
    ["tracks_of_polygons", [2, 2]],
  ]) {
    await withReel(streamBytes(name), async (reel) => {
      for (const [i, info] of reel.info.tracks.entries()) {
        const { nItems, nColumns } = info;
        const track = reel.track(info.name);
        let [nCorrected, maxError] = [0, 0];
        for (const number of reel.info.blocks.keys()) {
          const block = await track.fields(number);
          for (let t = 0; t < block.nFrames; t++) {
            const expected = await track.frame(block.start + t);
            const sums = Float64Array.from(expected, (_, at) => block.origin[at % nColumns]);
            for (let k = 0; k < block.nModes; k++) {
              for (let at = 0; at < sums.length; at++) {
                const weight = block.weights[(t * block.nModes + k) * nColumns + (at % nColumns)];
                sums[at] += weight * block.fields[k * nItems + Math.floor(at / nColumns)];
              }
            }
            for (let j = block.correctionStarts[t]; j < block.correctionStarts[t + 1]; j++) {
              nCorrected++;
              for (let c = 0; c < nColumns; c++) {
                const at = nColumns * block.correctionVertices[j] + c;
                sums[at] += block.correctionOffsets[nColumns * j + c];
              }
            }
            expected.forEach((one, at) => {
              const rounding = 2 ** -23 * Math.abs(one);
              maxError = Math.max(maxError, (Math.abs(sums[at] - one) - rounding) / scales[i]);
            });
          }
        }
        assert.ok(maxError < 1e-5, `${name} ${info.name}: ${maxError}`);
        if (info.name === "stress" || info.name === "σ") assert.ok(nCorrected > 0);
      }
    });
  }
});

const CASES = [
  ["an unknown kind", { kind: 7 }, UnsupportedVersionError, /a newer version/],
  ["an unknown coding", { coding: 9 }, UnsupportedVersionError, /a newer version/],
  ["a coding of normals", { coding: 2 }, CorruptStreamError, /the coding of a track does not match its kind/],
  ["a coding of velocities", { coding: 4 }, CorruptStreamError, /the coding of a track does not match its kind/],
  ["a bound and exact", { coding: 1 }, CorruptStreamError, /bytes follow a track/],
  ["a lossy coding of integers", { type: 34 }, CorruptStreamError, /a track of integers is not exact/],
  ["cells of a surface", { domain: 5 }, CorruptStreamError, /the mesh has none/],
  ["an unknown domain", { domain: 6 }, UnsupportedVersionError, /a newer version/],
  ["an unknown type", { type: 2 }, UnsupportedVersionError, /a newer version/],
  ["trailing bytes", { more: 1 }, CorruptStreamError, /bytes follow a track/],
  ["no columns", { nColumns: 0 }, CorruptStreamError, /number of columns of a track does not match its kind/],
  ["257 columns", { nColumns: 257 }, CorruptStreamError, /number of columns of a track does not match its kind/],
  ["columns of another kind", { kind: 2 }, CorruptStreamError, /number of columns of a track does not match its kind/],
  ["a bound below 0", { bound: -1 }, CorruptStreamError, /a bound, scale, origin or rate/],
  ["no scale", { scale: 0 }, CorruptStreamError, /a bound, scale, origin or rate/],
  ["an origin of NaN", { origin: NaN }, CorruptStreamError, /a bound, scale, origin or rate/],
  ["only two bytes", { length: 2 }, TruncatedStreamError, /./],
];

for (const [what, change, type, message] of CASES) {
  test(`a file with a track with ${what} is rejected`, async () => {
    const error = await ReelFile.open(withTrack(0, change)).catch((thrown) => thrown);
    assert.ok(error instanceof type, String(error));
    assert.match(error.message, message);
  });
}

function valuesHash(name, track) {
  return expectedOf(name).tracks.find((one) => one.name === track)["hash of values"];
}

test("a file with two tracks of the same name is rejected", async () => {
  await assert.rejects(ReelFile.open(withTrack(1, { name: "stress" })), {
    name: "CorruptStreamError",
    message: /two tracks have the same name/,
  });
});

test("damage in a track affects only its block", async () => {
  const bytes = Uint8Array.from(streamBytes("tracks"));
  const [, end] = groupsOf(bytes)[1][1];
  bytes[end - 9] ^= 1;
  await withReel(bytes, async (reel) => {
    const { blocks } = reel.info;
    const stress = reel.track("stress");
    await assert.rejects(stress.frame(blocks[1].start), CorruptStreamError);
    assert.equal((await stress.frame(blocks[0].start)).length, 42);
    assert.equal((await stress.frame(blocks[2].start)).length, 42);
    assert.equal(sha(...(await decodeAll(reel, reel))), expectedOf("tracks")["hash of positions"]);
  });
});

test("an exact track in a file without an index is found, and the rest is decoded", async () => {
  await withReel(withExactTrack(), async (reel) => {
    assert.deepEqual(reel.info.tracks.map(({ isExact }) => isExact), [false, false, true]);
    assert.equal(reel.info.blocks.length, 3);
    await assert.rejects(reel.track("σ").frame(0), {
      name: "CorruptStreamError", // its values are coefficients of modes
      message: /exact values are damaged/,
    });
    assert.equal(sha(...(await decodeAll(reel, reel.track("flow")))), valuesHash("tracks", "flow"));
    assert.equal(sha(...(await decodeAll(reel, reel))), expectedOf("tracks")["hash of positions"]);
  });
});

test("damaged flags of missing values are an error of their block", async () => {
  await withReel(withMissingValues(), async (reel) => {
    const stress = reel.track("stress");
    await assert.rejects(stress.frame(0), {
      name: "CorruptStreamError",
      message: /the flag of a missing value is neither 0 nor 1/,
    });
    assert.equal((await stress.frame(13)).length, 42);
  });
});

test("fields of exact and missing values yield the decoded values", async () => {
  let [nExact, nMissing] = [0, 0];
  for (const name of WITH_TRACKS) {
    await withReel(streamBytes(name), async (reel) => {
      for (const info of reel.info.tracks) {
        const track = reel.track(info.name);
        const columns = [info.nColumns - 1];
        for (const [number, { start, nFrames }] of reel.info.blocks.entries()) {
          const block = await track.fields(number, { columns });
          assert.equal(block.nColumns, 1);
          const frames = [];
          for (let t = 0; t < nFrames; t++) frames.push(await track.frame(start + t));
          const expected = frames.map((values) =>
            Array.from({ length: info.nItems }, (_, i) =>
              Number(values[i * info.nColumns + columns[0]]),
            ),
          );
          const finite = expected.flat().filter(Number.isFinite);
          const maxAbs = finite.reduce((max, one) => Math.max(max, Math.abs(one)), 0);
          const sums = sumFields(block);
          if (info.kind === "normal" && !info.isExact) continue; // fields are not normalized
          expected.forEach((values, t) =>
            values.forEach((value, i) => {
              if (Number.isFinite(value)) {
                const error = Math.abs(sums[t][i] - value);
                assert.ok(error <= 4e-5 * maxAbs, `${name} ${info.name}: ${value}, ${sums[t][i]}`);
              } else {
                assert.ok(Object.is(sums[t][i], value), `${name}: ${value}, ${sums[t][i]}`);
                nMissing++;
              }
            }),
          );
          nExact += info.isExact;
        }
      }
    });
  }
  assert.ok(nExact >= 8 && nMissing > 0, `${nExact} exact blocks, ${nMissing} values missing`);
});

/** Compute the values of the only column of fields, frame by frame. */
function sumFields({ nFrames, nModes, nVerts, origin, fields, weights, ...corrections }) {
  const { correctionStarts, correctionVertices, correctionOffsets } = corrections;
  return Array.from({ length: nFrames }, (_, t) => {
    const sums = new Float64Array(nVerts).fill(origin[0]);
    for (let k = 0; k < nModes; k++) {
      for (let i = 0; i < nVerts; i++) sums[i] += weights[t * nModes + k] * fields[k * nVerts + i];
    }
    for (let j = correctionStarts[t]; j < correctionStarts[t + 1]; j++) {
      sums[correctionVertices[j]] += correctionOffsets[j];
    }
    return sums;
  });
}

test("fields of an exact track have at most four valid columns", async () => {
  const names = WITH_TRACKS.filter((name) =>
    expectedOf(name).tracks.some(({ coding }) => coding === 1),
  );
  assert.ok(names.length >= 8);
  await withReel(streamBytes("tracks"), async (reel) => {
    await assert.rejects(reel.track("flow").fields(0, { columns: [2] }), {
      name: "InvalidInputError",
      message: "column must be an integer from 0 to 1; got 2",
    });
  });
  await withReel(streamBytes("exact_f4"), async (reel) => {
    const track = reel.track(reel.info.tracks[0].name);
    await assert.rejects(track.fields(0, { columns: [0, 0, 0, 0, 0] }), {
      name: "InvalidInputError",
      message: /at most 4 columns of an exact track can be requested at once; got 5/,
    });
  });
});

test("calls on tracks of a closed file throw", async () => {
  const reel = await ReelFile.open(streamBytes("tracks"));
  const stress = reel.track("stress");
  await stress.frame(0);
  const pending = stress.frame(13);
  reel.close();
  await assert.rejects(pending, { name: "AbortError" });
  await assert.rejects(stress.frame(0), { name: "AbortError" });
  await assert.rejects(reel.track("flow").frame(0), { name: "AbortError" });
});

test("frames are stored in the array that is passed, and others are refused", async () => {
  for (const name of WITH_TRACKS) {
    await withReel(streamBytes(name), async (reel) => {
      for (const item of [reel, ...reel.info.tracks.map((track) => reel.track(track.name))]) {
        const expected = await item.frame(reel.info.nFrames - 1);
        const array = await item.frame(0);
        assert.equal(await item.frame(reel.info.nFrames - 1, array), array);
        assert.deepEqual(array, expected);
        const Other = array instanceof Float32Array ? Float64Array : Float32Array;
        for (const other of [new Other(array.length), array.slice(1), {}, [...array], { signal }]) {
          await assert.rejects(item.frame(0, other), InvalidInputError);
        }
        assert.deepEqual(array, expected, "a failed call changed the array");
      }
    });
  }
  await withReel(streamBytes("tracks"), async (reel) => {
    const refused = reel.frame(0, new Float32Array(3));
    const length = 3 * reel.info.nVerts;
    const message = `must be a Float32Array of length ${length}; got a Float32Array of length 3`;
    await assert.rejects(refused, { message: `the array to reuse ${message}` });
  });
});

test("a canceled call on a track throws the reason", async () => {
  await withReel(streamBytes("tracks"), async (reel) => {
    assert.equal((await reel.track("flow").frame(0, null, { signal })).length, 84);
    const aborted = AbortSignal.abort(new Error("not now"));
    await assert.rejects(reel.track("flow").frame(0, null, { signal: aborted }), /not now/);
  });
});

test("fields of corners with shared values yield the decoded values", async () => {
  for (const name of ["corners_of_vertices", "corners_in_rows"]) {
    const reel = await ReelFile.open(streamBytes(name));
    for (const info of reel.info.tracks) {
      const track = reel.track(info.name);
      for (const number of reel.info.blocks.keys()) {
        await checkFields(track, info, await track.fields(number));
      }
    }
    reel.close();
  }
});

async function checkFields(track, { name, nItems, nColumns }, block) {
  const { fields, weights, nModes, nVerts, correctionStarts, correctionVertices } = block;
  assert.equal(nVerts, nItems);
  for (let k = 0; k < nModes; k++) {
    const sum = fields.subarray(k * nVerts, (k + 1) * nVerts).reduce((all, one) => all + one, 0);
    assert.ok(Math.abs(block.means[k] - sum / nVerts) < 1e-9);
  }
  for (let t = 0; t < block.nFrames; t++) {
    const expected = await track.frame(block.start + t);
    assert.equal(expected.length, nItems * nColumns);
    const sums = Float64Array.from(expected, (_, at) => block.origin[at % nColumns]);
    for (let k = 0; k < nModes; k++) {
      for (let at = 0; at < sums.length; at++) {
        const weight = weights[(t * nModes + k) * nColumns + (at % nColumns)];
        sums[at] += weight * fields[k * nItems + Math.floor(at / nColumns)];
      }
    }
    const corrected = correctionVertices.subarray(correctionStarts[t], correctionStarts[t + 1]);
    assert.ok(corrected.every((one, i) => i === 0 || one > corrected[i - 1]));
    corrected.forEach((corner, i) => {
      for (let c = 0; c < nColumns; c++) {
        const from = nColumns * (correctionStarts[t] + i) + c;
        sums[nColumns * corner + c] += block.correctionOffsets[from];
      }
    });
    expected.forEach((one, at) => {
      const isSame = Number.isNaN(one) ? Number.isNaN(sums[at]) : Math.abs(sums[at] - one) < 2e-3;
      assert.ok(isSame, `${name}: ${sums[at]}, ${one}`);
    });
  }
}
