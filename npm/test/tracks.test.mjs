// Tracks beside the positions: the same bits as in Python, and only what is asked for is read.

import assert from "node:assert/strict";
import { test } from "node:test";

import {
  CorruptStreamError,
  InvalidInputError,
  ReelFile,
  TruncatedStreamError,
  UnsupportedVersionError,
} from "../dist/index.js";
import { exactModule, loadInternals, newCore } from "./support/bundle.mjs";
import { PLAYED, bytesOf, said, sha } from "./support/streams.mjs";
import {
  largeTracks,
  withExactTrack,
  withMissingValues,
  withTrack,
} from "./support/track_streams.mjs";

const {
  Core,
  MeshReelError,
  Polygons,
  Section,
  TrackEngine,
  buildHierarchy,
  crc32,
  itemGraph,
  readSection,
  readStream,
} = await loadInternals();

const { signal } = new AbortController();
const WITH_TRACKS = PLAYED.filter((name) => said(name).tracks);

async function withReel(from, work, options) {
  const reel = await ReelFile.open(from, options);
  try {
    return await work(reel);
  } finally {
    reel.close();
  }
}

async function valuesOf(reel, track) {
  const found = [];
  for (let number = 0; number < reel.info.nFrames; number++) found.push(await track.frame(number));
  return found;
}

/** A blob that notes which of its bytes are read. */
function notedBlob(bytes) {
  const blob = new Blob([bytes]);
  const stretches = [];
  const slice = blob.slice.bind(blob);
  blob.slice = (start, end) => {
    stretches.push([start, end]);
    return slice(start, end);
  };
  return { blob, stretches };
}

test("values of every track are those of Python, to the bit", async () => {
  for (const name of WITH_TRACKS) {
    await withReel(bytesOf(name), async (reel) => {
      for (const { name: track, "hash of values": hash } of said(name).tracks) {
        assert.equal(sha(...(await valuesOf(reel, reel.track(track)))), hash, `${name}: ${track}`);
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

test("facts of a track say the shape and type of its values", async () => {
  const types = new Set();
  let nMissing = 0;
  for (const name of WITH_TRACKS) {
    await withReel(bytesOf(name), async (reel) => {
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
  await withReel(bytesOf("tracks"), ({ info }) => {
    assert.deepEqual(info.tracks[1], {
      name: "flow",
      unit: "m/s",
      kind: "vector",
      domain: "vertex",
      nColumns: 2,
      nItems: 42,
      numberType: "float64",
      isExact: false,
      promisedError: null,
      sizeBytes: readStream(bytesOf("tracks")).places.reduce((sum, one) => sum + one.sizes[2], 0),
    });
  });
});

test("frames of a track are the same in any order, and come into what is given", async () => {
  await withReel(bytesOf("tracks"), async (reel) => {
    const stress = reel.track("stress");
    const forwards = await valuesOf(reel, stress);
    const into = new Float32Array(42);
    for (let number = reel.info.nFrames - 1; number >= 0; number--) {
      assert.equal(await stress.frame(number, into), into);
      assert.deepEqual(into, forwards[number]);
    }
    await assert.rejects(stress.frame(0, new Float64Array(42)), /into must be a Float32Array of 42/);
    await assert.rejects(stress.frame(14), /there are frames 0 to 13; got frame 14/);
    await assert.rejects(stress.fields(3), InvalidInputError);
  });
});

test("a track that is not there is refused with the names of those that are", async () => {
  await withReel(bytesOf("tracks"), (reel) => {
    assert.throws(() => reel.track("strain"), {
      name: "InvalidInputError",
      message: 'there is no track "strain"; there are: "stress", "flow", "σ"',
    });
  });
  await withReel(bytesOf("sphere"), (reel) => {
    assert.throws(() => reel.track("stress"), /there are: none/);
  });
});

test("only bytes of the track that is asked for are read, block by block", async () => {
  const bytes = largeTracks();
  const { places } = readStream(bytes);
  assert.ok(bytes.length > 2 * 65536 && places.length > 2);
  const { blob, stretches } = notedBlob(bytes);
  const groupOf = (block, track) => {
    const { position, sizes } = places[block];
    const start = sizes.slice(0, track).reduce((sum, size) => sum + size, position);
    return [start, start + sizes[track]];
  };
  await withReel(blob, async (reel) => {
    stretches.length = 0;
    await reel.frame(reel.info.blocks[2].start);
    assert.deepEqual(stretches, [groupOf(2, 0)]);
    stretches.length = 0;
    const flow = reel.track("flow");
    await flow.frame(reel.info.blocks[2].start);
    assert.deepEqual(stretches, [groupOf(2, 2)]);
    await flow.frame(reel.info.blocks[2].start + 1);
    assert.equal(stretches.length, 1, "a block was read again");
    await flow.frame(reel.info.blocks[1].start);
    assert.deepEqual(stretches.slice(1), [groupOf(1, 2), groupOf(0, 2)]); // with its key block
  });
});

test("fields and weights make values within 1e-5 of the scale", async () => {
  for (const [name, scales] of [
    ["tracks", [3e5, 0.125, 1]],
    ["tracks_of_polygons", [2, 2]],
  ]) {
    await withReel(bytesOf(name), async (reel) => {
      for (const [i, info] of reel.info.tracks.entries()) {
        const { nItems, nColumns } = info;
        const track = reel.track(info.name);
        let [nCorrected, largest] = [0, 0];
        for (const number of reel.info.blocks.keys()) {
          const block = await track.fields(number);
          for (let t = 0; t < block.nFrames; t++) {
            const wanted = await track.frame(block.start + t);
            const found = Float64Array.from(wanted, (_, at) => block.origin[at % nColumns]);
            for (let k = 0; k < block.nModes; k++) {
              for (let at = 0; at < found.length; at++) {
                const weight = block.weights[(t * block.nModes + k) * nColumns + (at % nColumns)];
                found[at] += weight * block.fields[k * nItems + Math.floor(at / nColumns)];
              }
            }
            for (let j = block.correctionStarts[t]; j < block.correctionStarts[t + 1]; j++) {
              nCorrected++;
              for (let c = 0; c < nColumns; c++) {
                const at = nColumns * block.correctionVertices[j] + c;
                found[at] += block.correctionOffsets[nColumns * j + c];
              }
            }
            wanted.forEach((one, at) => {
              const rounding = 2 ** -23 * Math.abs(one);
              largest = Math.max(largest, (Math.abs(found[at] - one) - rounding) / scales[i]);
            });
          }
        }
        assert.ok(largest < 1e-5, `${name} ${info.name}: ${largest}`);
        if (info.name === "stress" || info.name === "σ") assert.ok(nCorrected > 0);
      }
    });
  }
});

const CASES = [
  ["a kind", { kind: 7 }, UnsupportedVersionError, /kind 7.*upgrade meshreel/, { kind: "unknown" }],
  ["a coding", { coding: 9 }, UnsupportedVersionError, /coding 9/, { isExact: false }],
  ["turns", { coding: 2 }, CorruptStreamError, /predicted as no other of each vertex/, {}],
  ["a rate", { coding: 4 }, CorruptStreamError, /predicted as no other of each vertex/, {}],
  ["an exact rate", { coding: 6 }, CorruptStreamError, /predicted as no other/, { isExact: true }],
  ["a bound and exact", { coding: 1 }, CorruptStreamError, /has 24 bytes.*0 are/, { promisedError: 0 }],
  ["integers", { type: 34 }, UnsupportedVersionError, /number type 34/, { numberType: "int16" }],
  ["bytes", { coding: 1, type: 17 }, CorruptStreamError, /type uint8/, { numberType: "uint8" }],
  ["modes, though exact", { coding: 1, exact: true }, CorruptStreamError, /0 to 0 are/, { isExact: true }],
  ["a domain", { domain: 5 }, UnsupportedVersionError, /domain 5/, { domain: "unknown", nItems: 0 }],
  ["a type", { type: 2 }, UnsupportedVersionError, /number type 2/, { numberType: "unknown" }],
  ["more behind it", { more: 1 }, CorruptStreamError, /has 25 bytes of numbers; 24 are needed/, {}],
  ["no columns", { nColumns: 0 }, CorruptStreamError, /0 columns; at most 256/, { nColumns: 0 }],
  ["257 columns", { nColumns: 257 }, CorruptStreamError, /257 columns/, { nColumns: 257 }],
  ["columns of another kind", { kind: 2 }, CorruptStreamError, /1 columns; velocity has not/, {}],
  ["a bound below 0", { bound: -1 }, CorruptStreamError, /a bound, scale, origin or rate that/, {}],
  ["no scale", { scale: 0 }, CorruptStreamError, /a bound, scale, origin or rate that cannot be/, {}],
  ["an origin of NaN", { origin: NaN }, CorruptStreamError, /that cannot be/, {}],
];

for (const [what, change, type, words, listed] of CASES) {
  test(`a track with ${what} is listed, and an error once it is asked for`, async () => {
    await withReel(withTrack(0, change), async (reel) => {
      const [info] = reel.info.tracks;
      for (const [key, value] of Object.entries({ name: "stress", ...listed })) {
        assert.equal(info[key], value);
      }
      const error = await reel.track("stress").frame(0).catch((thrown) => thrown);
      assert.ok(error instanceof type, String(error));
      assert.match(error.message, words);
      assert.equal(sha(...(await valuesOf(reel, reel.track("flow")))), hashOf("tracks", "flow"));
      const frames = await valuesOf(reel, reel);
      assert.equal(sha(...frames), said("tracks")["hash of positions"]);
    });
  });
}

function hashOf(name, track) {
  return said(name).tracks.find((one) => one.name === track)["hash of values"];
}

test("a track that is cut off has no name, and is an error", async () => {
  await withReel(withTrack(0, { length: 2 }), async (reel) => {
    assert.deepEqual({ ...reel.info.tracks[0], sizeBytes: 0 }, {
      name: "",
      unit: "",
      kind: "other",
      domain: "vertex",
      nColumns: 0,
      nItems: 42,
      numberType: "unknown",
      isExact: false,
      promisedError: null,
      sizeBytes: 0,
    });
    await assert.rejects(reel.track("").frame(0), TruncatedStreamError);
  });
});

test("two tracks of one name are an error once a track is asked for", async () => {
  await withReel(withTrack(1, { name: "stress" }), async (reel) => {
    assert.deepEqual(reel.info.tracks.map(({ name }) => name), ["stress", "stress", "σ"]);
    assert.throws(() => reel.track("stress"), {
      name: "CorruptStreamError",
      message: "two tracks of the stream have one name",
    });
    assert.equal(sha(...(await valuesOf(reel, reel))), said("tracks")["hash of positions"]);
  });
});

test("damage in a track is an error of its block alone", async () => {
  const bytes = Uint8Array.from(bytesOf("tracks"));
  const { position, sizes } = readStream(bytes).places[1];
  bytes[position + sizes[0] + sizes[1] - 9] ^= 1;
  await withReel(bytes, async (reel) => {
    const { blocks } = reel.info;
    const stress = reel.track("stress");
    await assert.rejects(stress.frame(blocks[1].start), CorruptStreamError);
    assert.equal((await stress.frame(blocks[0].start)).length, 42);
    assert.equal((await stress.frame(blocks[2].start)).length, 42);
    assert.equal(sha(...(await valuesOf(reel, reel))), said("tracks")["hash of positions"]);
  });
});

test("an exact track is found where the stream has no index, and all else is decoded", async () => {
  await withReel(withExactTrack(), async (reel) => {
    assert.deepEqual(reel.info.tracks.map(({ isExact }) => isExact), [false, false, true]);
    assert.equal(reel.info.blocks.length, 3);
    await assert.rejects(reel.track("σ").frame(0), {
      name: "CorruptStreamError", // its values are the coefficients of modes
      message: /the values are (damaged|cut off)/,
    });
    assert.equal(sha(...(await valuesOf(reel, reel.track("flow")))), hashOf("tracks", "flow"));
    assert.equal(sha(...(await valuesOf(reel, reel))), said("tracks")["hash of positions"]);
  });
});

test("a block is an error where what says that values are missing is damaged", async () => {
  await withReel(withMissingValues(), async (reel) => {
    const stress = reel.track("stress");
    await assert.rejects(stress.frame(0), {
      name: "CorruptStreamError",
      message: /block 0 of a track says 255 of whether a value is missing; 0 and 1 are allowed/,
    });
    assert.equal((await stress.frame(13)).length, 42);
  });
});

test("fields of exact values, and of missing ones, make the same numbers", async () => {
  let [nExact, nMissing] = [0, 0];
  for (const name of WITH_TRACKS) {
    await withReel(bytesOf(name), async (reel) => {
      for (const info of reel.info.tracks) {
        const track = reel.track(info.name);
        const columns = [info.nColumns - 1];
        for (const [number, { start, nFrames }] of reel.info.blocks.entries()) {
          const block = await track.fields(number, { columns });
          assert.equal(block.nColumns, 1);
          const frames = [];
          for (let t = 0; t < nFrames; t++) frames.push(await track.frame(start + t));
          const wanted = frames.map((values) =>
            Array.from({ length: info.nItems }, (_, i) =>
              Number(values[i * info.nColumns + columns[0]]),
            ),
          );
          const finite = wanted.flat().filter(Number.isFinite);
          const most = finite.reduce((largest, one) => Math.max(largest, Math.abs(one)), 0);
          const found = sumsOf(block);
          if (info.kind === "normal" && !info.isExact) continue; // not yet divided by their length
          wanted.forEach((values, t) =>
            values.forEach((value, i) => {
              if (Number.isFinite(value)) {
                const off = Math.abs(found[t][i] - value);
                assert.ok(off <= 2e-5 * most, `${name} ${info.name}: ${value}, ${found[t][i]}`);
              } else {
                assert.ok(Object.is(found[t][i], value), `${name}: ${value}, ${found[t][i]}`);
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

/** Numbers that the only column of fields makes, frame after frame. */
function sumsOf({ nFrames, nModes, nVerts, origin, fields, weights, ...corrections }) {
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

test("columns of an exact track as fields are at most four, and all are there", async () => {
  const names = WITH_TRACKS.filter((name) =>
    said(name).tracks.some(({ coding }) => coding === 1),
  );
  assert.ok(names.length >= 8);
  await withReel(bytesOf("tracks"), async (reel) => {
    await assert.rejects(reel.track("flow").fields(0, { columns: [2] }), {
      name: "InvalidInputError",
      message: "there are columns 0 to 1; got column 2",
    });
  });
  await withReel(bytesOf("exact_f4"), async (reel) => {
    const track = reel.track(reel.info.tracks[0].name);
    await assert.rejects(track.fields(0, { columns: [0, 0, 0, 0, 0] }), {
      name: "InvalidInputError",
      message: /at most 4 columns are fields at once; got 5/,
    });
  });
});

test("a track is refused where a block of it takes more memory than allowed", async () => {
  const open = { worker: false, memory: 200_000 };
  await withReel(
    bytesOf("still_track"),
    async (reel) => {
      await assert.rejects(reel.track("wide").frame(0), {
        name: "MemoryLimitError",
        message: /^block 0 of 6 frames takes 229632 bytes of memory; 200000 are allowed: open it with more `memory`$/,
      });
      assert.equal(sha(...(await valuesOf(reel, reel))), said("still_track")["hash of positions"]);
    },
    open,
  );
});

/** Random numbers of 0..1, the same each time. */
function randomNumbers(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

/** Payloads that only tracks are made of: where they and their sections begin and end. */
function payloadsOfTracks(bytes) {
  const { header, places } = readStream(bytes);
  const groups = places.map(({ position, sizes }) => {
    const end = position + sizes.reduce((sum, size) => sum + size);
    return [position + sizes[0], end];
  });
  const found = [];
  for (const [first, last] of [[header.sizeBytes, places[0].position], ...groups]) {
    for (let start = first; start < last;) {
      const { id, payload, end } = readSection({ bytes, start: 0 }, start, last);
      const isOfTrack = first > header.sizeBytes || id === Section.TRACK;
      const begin = payload.byteOffset - bytes.byteOffset;
      if (isOfTrack && payload.length) found.push({ start, begin, end });
      start = end;
    }
  }
  return found;
}

test("damage with right checksums gives an error of the package, or some values", async () => {
  const random = randomNumbers(16);
  let [nErrors, nValues] = [0, 0];
  for (const name of WITH_TRACKS) {
    const whole = bytesOf(name);
    const payloads = payloadsOfTracks(whole);
    const core = newCore(Core);
    for (let turn = 0; turn < 20; turn++) {
      const bytes = whole.slice();
      const { start, begin, end } = payloads[turn % payloads.length];
      bytes[begin + Math.floor((end - 4 - begin) * random())] = Math.floor(256 * random());
      const sum = crc32(bytes.subarray(start, end - 4));
      new DataView(bytes.buffer).setUint32(end - 4, sum, true);
      const stream = readStream(bytes);
      const read = async (from, to) => bytes.slice(from, to);
      const engine = new TrackEngine(core, read, stream, async () => exactModule());
      for (const track of said(name).tracks.keys()) {
        try {
          for (let t = 0; t < stream.starts.at(-1); t++) {
            nValues += (await engine.values(track, t, signal)).length > 0;
          }
          for (const block of stream.places.keys()) {
            await engine.fields(track, block, [0], signal);
          }
        } catch (error) {
          if (!(error instanceof MeshReelError)) throw error;
          nErrors++;
        }
      }
    }
  }
  assert.ok(nErrors > 50 && nValues > 500, `${nErrors} errors, ${nValues} values`);
});

test("a file that is closed answers nothing more of its tracks", async () => {
  const reel = await ReelFile.open(bytesOf("tracks"));
  const stress = reel.track("stress");
  await stress.frame(0);
  const waiting = stress.frame(13);
  reel.close();
  await assert.rejects(waiting, { name: "AbortError" });
  await assert.rejects(stress.frame(0), { name: "AbortError" });
  await assert.rejects(reel.track("flow").frame(0), { name: "AbortError" });
});

test("a question about a track that is taken back throws the reason", async () => {
  await withReel(bytesOf("tracks"), async (reel) => {
    assert.equal((await reel.track("flow").frame(0, undefined, { signal })).length, 84);
    const aborted = AbortSignal.abort(new Error("not now"));
    await assert.rejects(reel.track("flow").frame(0, undefined, { signal: aborted }), /not now/);
  });
});

test("one face has a graph of no edges, and three corners", () => {
  const core = newCore(Core);
  const polygons = new Polygons(Uint32Array.of(0, 1, 2), 3, null);
  for (const [domain, nItems, nPairs] of [["face", 1, 0], ["corner", 3, 3]]) {
    const graph = itemGraph(core, domain, polygons);
    assert.deepEqual([graph.nVerts, graph.nFaces], [nItems, nPairs]);
    const { parts, rows } = buildHierarchy(core, graph, 4);
    assert.equal(rows.length, nItems);
    for (const part of [...parts, graph.internalFaces]) core.heap.give(part);
  }
  assert.equal(core.heap.usedBytes, 0);
});
