// Every stream of conformance/ decodes to what is said of it, with and without vectors.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { engineOf, loadInternals } from "./support/bundle.mjs";
import {
  OTHERS,
  PLAYED,
  REELS,
  bytesOf,
  framesOfBlocks,
  hashOf,
  said,
  sha,
} from "./support/streams.mjs";

const internals = await loadInternals();
const { UnsupportedVersionError } = internals;
const { signal } = new AbortController();

const KINDS = ["other", "vector", "velocity", "normal", "color", "uv", "scalar"];
const DOMAINS = ["vertex", "face", "corner"];
const LETTERS = { Uint8Array: "B", Int32Array: "i", Float32Array: "f", Float64Array: "d" };

async function hashOfFrames(engine, track) {
  const frames = [];
  for (let t = 0; t < engine.info.nFrames; t++) frames.push(await engine.frame(track, t, signal));
  return sha(...frames);
}

/** Pairs of vertices, ordered by the first, then by the second. */
function ascending(edges) {
  const pairs = Array.from({ length: edges.length / 2 }, (_, i) => [edges[2 * i], edges[2 * i + 1]]);
  return pairs.sort(([a, b], [c, d]) => a - c || b - d).flat();
}

for (const [module, names] of [["reel", REELS], ["reel_whole", PLAYED], ["reel_plain", PLAYED]]) {
  test(`positions and tracks are those of every stream, by ${module}`, async () => {
    assert.ok(names.length >= 69);
    for (const name of names) {
      const engine = await engineOf(internals, bytesOf(name), module);
      assert.equal(await hashOfFrames(engine, 0), said(name)["hash of positions"], name);
      const tracks = module === "reel" ? [] : (said(name).tracks ?? []);
      for (const [i, { name: track, "hash of values": hash }] of tracks.entries()) {
        assert.equal(await hashOfFrames(engine, 1 + i), hash, `${name}: ${track}`);
      }
    }
  });
}

test("surfaces are those of every stream", async () => {
  for (const name of PLAYED) {
    const wanted = said(name);
    const { surface } = await engineOf(internals, bytesOf(name), "reel");
    assert.equal(hashOf(surface.triangles), wanted["hash of faces"], name);
    assert.equal(surface.faceSizes?.length ?? null, wanted.polygons, name);
    if (surface.faceSizes) assert.equal(hashOf(surface.faceSizes), wanted["hash of polygons"]);
    const hard = ascending(surface.hardEdges ?? []);
    assert.equal(hard.length / 2, wanted["hard edges"] ?? 0, name);
    if (hard.length) assert.equal(hashOf(hard), wanted["hash of hard edges"], name);
    assert.deepEqual(
      surface.attributes.map(({ name, kind, domain, width, values }) => ({
        ...{ name, kind, domain, width },
        type: LETTERS[values.constructor.name],
      })),
      wanted.attributes.map(({ name, kind, domain, width, type }) => ({
        ...{ name, kind, domain, width, type },
      })),
    );
    surface.attributes.forEach(({ values, width }, i) => {
      const { "hash of rows": rows, "hash of values": hash, "n rows": nRows } = wanted.attributes[i];
      if (!rows) assert.equal(sha(values), hash, name);
      const found = new Set(); // rows that are named are repeated
      for (let at = 0; at < values.length; at += width) found.add(sha(values.subarray(at, at + width)));
      assert.ok(found.size <= nRows, name);
    });
    assert.deepEqual(
      surface.groups.map(({ name, labels, ofFace }) => ({
        name,
        labels,
        "hash of numbers": hashOf(ofFace),
      })),
      wanted.groups,
    );
    assert.deepEqual(
      surface.images.map(({ name, mediaType, bytes }) => ({
        name,
        type: mediaType,
        hash: sha(bytes),
      })),
      wanted.images,
    );
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
      wanted.materials.map(({ textures, ...one }) => ({
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

test("facts are those of every stream", async () => {
  for (const name of PLAYED) {
    const wanted = said(name);
    const { info } = await engineOf(internals, bytesOf(name));
    assert.deepEqual(
      {
        method: info.method,
        frames: info.nFrames,
        vertices: info.nVerts,
        faces: info.nFaces,
        fps: info.fps,
        name: info.name,
        start: info.startS,
        promise: info.promisePercent,
        type: info.numberType,
        tracks: info.tracks.map(({ name, unit, kind, domain, promisedError }) => ({
          ...{ name, unit, kind, domain, promisedError },
        })),
        blocks: info.blocks.map((block) => block.nFrames),
      },
      {
        method: wanted.method,
        frames: wanted.frames,
        vertices: wanted.vertices,
        faces: wanted.faces,
        fps: wanted.fps,
        name: wanted.name,
        start: wanted.start ?? 0,
        promise: wanted.promise,
        type: wanted["vertex type"] === 4 ? "float32" : "float64",
        tracks: (wanted.tracks ?? []).map(({ name, unit, kind, domain, coding, bound }) => ({
          name,
          unit,
          kind: KINDS[kind],
          domain: DOMAINS[domain],
          promisedError: coding === 1 || coding > 5 ? 0 : bound || null,
        })),
        blocks: framesOfBlocks(wanted),
      },
      name,
    );
  }
});

test("other methods are refused with what to do", async () => {
  assert.ok(OTHERS.length >= 8);
  for (const name of OTHERS) {
    await assert.rejects(
      engineOf(internals, bytesOf(name)),
      (error) =>
        error instanceof UnsupportedVersionError &&
        error.message.includes(said(name).method) &&
        error.message.includes("pages decode reel, lossless and grid: encode the original again"),
    );
  }
});

test("streams that break a rule of the format are refused", async () => {
  const folder = new URL("../../conformance/refused/", import.meta.url);
  const names = readdirSync(folder);
  assert.ok(names.length >= 7);
  for (const name of names) {
    const data = new Uint8Array(readFileSync(new URL(name, folder)));
    const decode = async () => (await engineOf(internals, data)).frame(0, 0, signal);
    await assert.rejects(decode, { name: "CorruptStreamError" }, name);
  }
});

test("the module for first pictures refuses what it leaves out", async () => {
  const tracks = await engineOf(internals, bytesOf("tracks"), "reel");
  await assert.rejects(tracks.frame(1, 0, signal), UnsupportedVersionError);
  const exact = await engineOf(internals, bytesOf("lossless"), "reel");
  await assert.rejects(exact.frame(0, 0, signal), UnsupportedVersionError);
});

test("segments are opened one by one", async () => {
  const folder = new URL("../../conformance/segments/", import.meta.url);
  const names = readdirSync(folder).filter((file) => file.endsWith(".reel"));
  assert.ok(names.length >= 5);
  for (const name of names) {
    const data = new Uint8Array(readFileSync(new URL(name, folder)));
    const text = readFileSync(new URL(name.replace(".reel", ".json"), folder), "utf8");
    const { segments } = JSON.parse(text);
    const several = new RegExp(`has ${segments.length} segments.*segment 0 to ${segments.length - 1}`);
    if (segments[0].method === "reel") {
      const open = engineOf(internals, data);
      await assert.rejects(open, { name: "InvalidInputError", message: several });
    }
    for (const [number, wanted] of segments.entries()) {
      if (!["reel", "lossless", "grid"].includes(wanted.method)) continue;
      const engine = await engineOf(internals, data, "reel_whole", 2 ** 31, number);
      assert.equal(await hashOfFrames(engine, 0), wanted["hash of positions"], name);
      assert.equal(hashOf(engine.surface.triangles), wanted["hash of faces"], name);
    }
    const behind = engineOf(internals, data, "reel", 2 ** 31, segments.length);
    await assert.rejects(behind, { name: "InvalidInputError" });
  }
});
