// All streams of conformance/ decode to the documented values.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { openEngine, loadInternals } from "./support/bundle.mjs";
import {
  OTHERS,
  PLAYED,
  streamBytes,
  blockLengths,
  integerHash,
  expectedOf,
  sha,
} from "./support/streams.mjs";

const internals = await loadInternals();
const { UnsupportedVersionError } = internals;
const { signal } = new AbortController();

const KINDS = ["other", "vector", "velocity", "normal", "color", "uv", "scalar"];
const DOMAINS = ["vertex", "face", "corner", "cell"];
const LETTERS = { Uint8Array: "B", Int32Array: "i", Float32Array: "f", Float64Array: "d" };

async function framesHash(engine, track) {
  const frames = [];
  for (let t = 0; t < engine.info.nFrames; t++) frames.push(await engine.frame(track, t, signal));
  return sha(...frames);
}

/** Pairs of vertices, ordered by the first, then by the second. */
function ascending(edges) {
  const pairs = Array.from({ length: edges.length / 2 }, (_, i) => [edges[2 * i], edges[2 * i + 1]]);
  return pairs.sort(([a, b], [c, d]) => a - c || b - d).flat();
}

test("positions and tracks of every stream are right", async () => {
  assert.ok(PLAYED.length >= 69);
  for (const name of PLAYED) {
    const engine = await openEngine(internals, streamBytes(name));
    assert.equal(await framesHash(engine, 0), expectedOf(name)["hash of positions"], name);
    const tracks = expectedOf(name).tracks ?? [];
    for (const [i, { name: track, "hash of values": hash }] of tracks.entries()) {
      assert.equal(await framesHash(engine, 1 + i), hash, `${name}: ${track}`);
    }
  }
});

test("the module for meshes decodes the same values, or asks for the other module", async () => {
  for (const name of PLAYED) {
    const { method, cells, tracks = [], ...expected } = expectedOf(name);
    const hashOrLack = async (track) => {
      try {
        return await framesHash(await openEngine(internals, streamBytes(name), { module: "reel.wasm" }), track);
      } catch (error) {
        return error.name;
      }
    };
    const hashes = [expected["hash of positions"], ...tracks.map((track) => track["hash of values"])];
    const results = await Promise.all(hashes.map((_, track) => hashOrLack(track)));
    const lacks = results.map((result) => result === "IncompleteModule");
    assert.deepEqual(results.filter((_, i) => !lacks[i]), hashes.filter((_, i) => !lacks[i]), name);
    if (method === "lossless" || cells) assert.ok(lacks.every(Boolean), name);
    else if (method === "reel") assert.ok(!lacks[0], name);
    if (/^exact_/.test(name)) assert.ok(lacks.at(-1), name);
    if (["tracks", "normals"].includes(name)) assert.ok(!lacks.some(Boolean), name);
  }
});

test("surfaces of every stream are right", async () => {
  for (const name of PLAYED) {
    const expected = expectedOf(name);
    const engine = await openEngine(internals, streamBytes(name));
    const { surface } = engine;
    assert.equal(integerHash(surface.triangles), expected["hash of faces"], name);
    assert.equal(surface.faceSizes?.length ?? null, expected.polygons, name);
    if (surface.faceSizes) {
      assert.equal(integerHash(surface.faceSizes), expected["hash of polygons"]);
      assert.equal(integerHash(surface.triangleCorners), expected["hash of corners"]);
    }
    assert.equal(surface.cells?.types.length, expected.cells, name);
    if (surface.cells) {
      assert.equal(integerHash(surface.cells.types), expected["hash of cell types"], name);
      assert.equal(integerHash(surface.cells.nodes), expected["hash of cell nodes"], name);
      assert.equal(surface.cells.faceCells.length, surface.faceSizes?.length ?? surface.triangles.length / 3);
    }
    const hard = ascending(surface.hardEdges ?? []);
    assert.equal(hard.length / 2, expected["hard edges"] ?? 0, name);
    if (hard.length) assert.equal(integerHash(hard), expected["hash of hard edges"], name);
    assert.deepEqual(
      surface.attributes.map(({ name, kind, domain, width, values }) => ({
        ...{ name, kind, domain, width },
        type: LETTERS[values.constructor.name],
      })),
      expected.attributes.map(({ name, kind, domain, width, type }) => ({
        ...{ name, kind, domain, width, type },
      })),
    );
    surface.attributes.forEach(({ values, width }, i) => {
      const { "hash of rows": rows, "hash of values": hash, "n rows": nRows } = expected.attributes[i];
      if (!rows) assert.equal(sha(values), hash, name);
      const distinct = new Set(); // rows that the file shares are repeated
      for (let i = 0; i < values.length; i += width) distinct.add(sha(values.subarray(i, i + width)));
      assert.ok(distinct.size <= nRows, name);
    });
    assert.deepEqual(
      surface.groups.map(({ name, labels, faceLabels }) => ({
        name,
        labels,
        "hash of numbers": integerHash(faceLabels),
      })),
      expected.groups,
    );
    const images = surface.images.map(async ({ name, mediaType, sizeBytes }, i) => {
      const bytes = await engine.image(i, new AbortController().signal);
      assert.equal(bytes.length, sizeBytes);
      return { name, type: mediaType, hash: sha(bytes) };
    });
    assert.deepEqual(await Promise.all(images), expected.images);
    assert.deepEqual(
      surface.materials.map((one) => ({
        name: one.name,
        "alpha mode": one.alphaMode,
        numbers: [
          ...one.baseColor,
          one.metallic,
          one.roughness,
          ...one.emissive,
          one.normalScale,
          one.occlusionStrength,
          one.alphaCutoff,
        ],
        "double sided": one.doubleSided,
        unlit: one.unlit,
        textures: one.textures.map((texture) => ({
          image: texture.image,
          uv: texture.uv,
          wrap: [texture.wrapU, texture.wrapV],
          numbers: [...texture.offset, texture.rotation, ...texture.scale],
        })),
      })),
      expected.materials.map(({ textures, ...one }) => ({
        ...one,
        textures: Object.values(textures).map(({ image, uv, wrap, numbers }) => ({
          image,
          uv,
          wrap,
          numbers,
        })),
      })),
    );
  }
});

test("metadata of every stream is right", async () => {
  for (const name of PLAYED) {
    const expected = expectedOf(name);
    const { info } = await openEngine(internals, streamBytes(name));
    assert.deepEqual(
      {
        method: info.method,
        frames: info.nFrames,
        vertices: info.nVerts,
        faces: info.nFaces,
        fps: info.times ? null : info.fps,
        times: info.times && [...info.times],
        name: info.name,
        start: info.startS,
        errorBound: info.errorBoundPercent,
        type: info.numberType,
        tracks: info.tracks.map(({ name, unit, kind, domain, errorBound }) => ({
          ...{ name, unit, kind, domain, errorBound },
        })),
        blocks: info.blocks.map((block) => block.nFrames),
      },
      {
        method: expected.method,
        frames: expected.frames,
        vertices: expected.vertices,
        faces: expected.faces,
        fps: expected.fps,
        times: expected.times ?? null,
        name: expected.name,
        start: expected.times?.[0] ?? expected.start ?? 0,
        errorBound: expected["error bound"],
        type: expected["vertex type"] === 4 ? "float32" : "float64",
        tracks: (expected.tracks ?? []).map(({ name, unit, kind, domain, coding, bound }) => ({
          name,
          unit,
          kind: KINDS[kind],
          domain: DOMAINS[domain],
          errorBound: bound || (coding === 1 || coding > 5 ? 0 : null),
        })),
        blocks: blockLengths(expected),
      },
      name,
    );
  }
});

test("other methods are rejected with advice", async () => {
  assert.ok(OTHERS.length >= 8);
  for (const name of OTHERS) {
    await assert.rejects(
      openEngine(internals, streamBytes(name)),
      (error) =>
        error instanceof UnsupportedVersionError &&
        error.message.includes(expectedOf(name).method) &&
        error.message.includes("decodes reel, lossless and grid: encode the original again"),
    );
  }
});

test("streams that violate the format are rejected", async () => {
  const folder = new URL("../../conformance/refused/", import.meta.url);
  const names = readdirSync(folder);
  assert.ok(names.length >= 7);
  for (const name of names) {
    const data = new Uint8Array(readFileSync(new URL(name, folder)));
    const decode = async () => {
      const engine = await openEngine(internals, data);
      for (let track = 0; track <= engine.info.tracks.length; track++) {
        await engine.frame(track, 0, signal);
      }
    };
    await assert.rejects(decode, { name: "CorruptStreamError" }, name);
  }
});

test("segments can be opened separately", async () => {
  const folder = new URL("../../conformance/segments/", import.meta.url);
  const names = readdirSync(folder).filter((file) => file.endsWith(".reel"));
  assert.ok(names.length >= 5);
  for (const name of names) {
    const data = new Uint8Array(readFileSync(new URL(name, folder)));
    const text = readFileSync(new URL(name.replace(".reel", ".json"), folder), "utf8");
    const { segments } = JSON.parse(text);
    const several = new RegExp(`has ${segments.length} segments.*segment 0 to ${segments.length - 1}`);
    if (segments[0].method === "reel") {
      const open = openEngine(internals, data);
      await assert.rejects(open, { name: "InvalidInputError", message: several });
    }
    for (const [number, expected] of segments.entries()) {
      if (!["reel", "lossless", "grid"].includes(expected.method)) continue;
      const engine = await openEngine(internals, data, { segment: number });
      assert.equal(await framesHash(engine, 0), expected["hash of positions"], name);
      assert.equal(integerHash(engine.surface.triangles), expected["hash of faces"], name);
    }
    const outOfRange = openEngine(internals, data, { segment: segments.length });
    await assert.rejects(outOfRange, { name: "InvalidInputError" });
  }
});
