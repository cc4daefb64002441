// Tracks of corners that share values: the rows they have, and fields of each corner.

import assert from "node:assert/strict";
import { test } from "node:test";

import { ReelFile } from "../dist/index.js";
import { loadInternals, newCore } from "./support/bundle.mjs";
import { bytesOf } from "./support/streams.mjs";

const { Core, CorruptStreamError, Polygons, readCornerRows } = await loadInternals();

/** A quad and a triangle with a vertex between them; internal numbers of vertices are turned. */
const POLYGONS = new Polygons(Uint32Array.of(1, 3, 1, 1, 1, 3, 1, 0, 1), 4, Uint32Array.of(4, 3));
const SEQUENCE = Int32Array.of(3, 2, 1, 0);

/** The corners are of the vertices 1, 3, 1, 3 and 1, 0, 1; vertex 1 is 2 in internal order. */
function rowsOf(hex, sequence = SEQUENCE) {
  const core = newCore(Core);
  try {
    return readCornerRows(core, Uint8Array.from(hex.split(" "), (one) => parseInt(one, 16)), POLYGONS, sequence);
  } finally {
    assert.equal(core.heap.usedBytes, 0);
  }
}

test("corners have the row of their vertex, of a corner before, or the next", () => {
  const { nRows, ofCorners, vertices } = rowsOf("03 9e f5"); // 0 0 1 0, then 1 2 2
  assert.deepEqual([...ofCorners], [2, 0, 4, 0, 2, 3, 4]);
  assert.equal(nRows, 5);
  assert.deepEqual([...vertices], [3, 2, 1, 0, 1]);
  assert.deepEqual([...rowsOf("00 ff").ofCorners], [2, 0, 2, 0, 2, 3, 2]);
});

for (const [hex, words] of [
  ["03 9e b4 c4", /a corner that its vertex does not have/], // 2 1 1
  ["03 9f 09 89", /a corner that its vertex does not have/], // 1 1 4
  ["03 9f", /a corner that its vertex does not have/], // 1 -1 1
  ["03 9a 71", /neither has a seam nor has none/], // of a vertex 2
  ["02 9f 1b", /not as many corners at seams/], // of two corners
  ["03 7d 06", /not as many corners at seams/], // of three vertices
  ["08 9f 19", /not as many corners at seams/],
  ["03", /neither has a seam nor has none/], // no bytes: all are 0 and 1 as their models guess
]) {
  test(`rows ${hex} are refused`, () => {
    assert.throws(() => rowsOf(hex), (error) => {
      assert.ok(error instanceof CorruptStreamError, String(error));
      assert.match(error.message, words);
      return true;
    });
  });
}

test("fields of corners that share values are those of their frames", async () => {
  for (const name of ["corners_of_vertices", "corners_in_rows"]) {
    const reel = await ReelFile.open(bytesOf(name));
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
    const wanted = await track.frame(block.start + t);
    assert.equal(wanted.length, nItems * nColumns);
    const found = Float64Array.from(wanted, (_, at) => block.origin[at % nColumns]);
    for (let k = 0; k < nModes; k++) {
      for (let at = 0; at < found.length; at++) {
        const weight = weights[(t * nModes + k) * nColumns + (at % nColumns)];
        found[at] += weight * fields[k * nItems + Math.floor(at / nColumns)];
      }
    }
    const corrected = correctionVertices.subarray(correctionStarts[t], correctionStarts[t + 1]);
    assert.ok(corrected.every((one, i) => i === 0 || one > corrected[i - 1]));
    corrected.forEach((corner, i) => {
      for (let c = 0; c < nColumns; c++) {
        const from = nColumns * (correctionStarts[t] + i) + c;
        found[nColumns * corner + c] += block.correctionOffsets[from];
      }
    });
    wanted.forEach((one, at) => {
      const isSame = Number.isNaN(one) ? Number.isNaN(found[at]) : Math.abs(found[at] - one) < 2e-3;
      assert.ok(isSame, `${name}: ${found[at]}, ${one}`);
    });
  }
}

test("bytes of a track are those of its blocks and of its rows", async () => {
  const reel = await ReelFile.open(bytesOf("corners_in_rows"));
  const sizes = Object.fromEntries(reel.info.tracks.map(({ name, sizeBytes }) => [name, sizeBytes]));
  reel.close();
  assert.deepEqual(sizes, { wave: 385, gaps: 1009, whole: 330, normals: 397, own: 1576 });
});
