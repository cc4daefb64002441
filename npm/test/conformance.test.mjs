// Every stream of conformance/ decodes to what is said of it, with and without vectors.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { exactModule, loadInternals, newCore } from "./support/bundle.mjs";
import {
  EXACTS,
  OTHERS,
  PLAYED,
  REELS,
  bytesOf,
  framesOfBlocks,
  hashOf,
  said,
  sha,
} from "./support/streams.mjs";

const {
  Core,
  MemoryReel,
  POSITIONS,
  Polygons,
  Section,
  TrackEngine,
  UnsupportedVersionError,
  buildHierarchy,
  decodeConnectivity,
  decodeFields,
  readAttribute,
  readBlock,
  readCorrections,
  readStream,
} = await loadInternals();

const KINDS = ["other", "vector", "velocity", "normal", "color", "uv", "scalar"];
const DOMAINS = ["vertex", "face", "corner"];
const LETTERS = { Uint8Array: "B", Int32Array: "i", Float32Array: "f", Float64Array: "d" };

function positionsHash(reel) {
  const frames = reel.info.blocks.flatMap((_, number) => {
    const block = reel.decodeBlock(number);
    const found = Array.from({ length: block.nFrames }, (_, t) => reel.frameOf(block, t));
    block.close();
    return found;
  });
  return sha(...frames);
}

/** Pairs of vertices, ordered by the first, then by the second. */
function ascending(edges) {
  const pairs = Array.from({ length: edges.length / 2 }, (_, i) => [edges[2 * i], edges[2 * i + 1]]);
  return pairs.sort(([a, b], [c, d]) => a - c || b - d).flat();
}

for (const module of ["reel", "reel_plain"]) {
  test(`positions are those of every stream, by ${module}`, () => {
    assert.ok(REELS.length >= 69);
    for (const name of REELS) {
      const core = newCore(Core, module);
      const reel = new MemoryReel(core, bytesOf(name));
      assert.equal(positionsHash(reel), said(name)["hash of positions"], name);
      reel.close();
      assert.equal(core.heap.usedBytes, 0, `${name} leaves memory in use`);
    }
  });

  test(`exact positions are those of every stream, by ${module}`, async () => {
    assert.ok(EXACTS.length >= 14);
    const { signal } = new AbortController();
    for (const name of EXACTS) {
      const bytes = bytesOf(name);
      const core = newCore(Core, module);
      const stream = readStream(bytes);
      const read = async (from, to) => bytes.slice(from, to);
      const engine = new TrackEngine(core, read, stream, async () => exactModule());
      const frames = [];
      for (let t = 0; t < stream.starts.at(-1); t++) {
        frames.push(await engine.values(POSITIONS, t, signal));
      }
      assert.equal(sha(...frames), said(name)["hash of positions"], name);
    }
  });

  test(`integers are those of every stream, by ${module}`, () => {
    for (const name of REELS) {
      const core = newCore(Core, module);
      const stream = readStream(bytesOf(name));
      const wanted = said(name);
      const connectivity = decodeConnectivity(core, stream.header, stream.leading);
      const { nFaces, nVerts, sequence, triangles } = connectivity;
      const internal = core.int32s(connectivity.internalFaces, 3 * nFaces);
      assert.equal(hashOf(internal), wanted["hash of internal faces"], name);
      assert.equal(hashOf(triangles), wanted["hash of faces"], name);
      assert.equal(hashOf(sequence), wanted["hash of order"], name);
      const places = sequence.map((_, v) => v); // corrections are described in internal numbers
      stream.places.forEach((place, number) => {
        const bytes = bytesOf(name).subarray(place.position);
        const stored = readBlock(bytes, place, number, stream.starts[number]);
        const block = wanted.blocks[number];
        const { nModes, nFrames, layout, sections } = stored;
        assert.deepEqual(
          [
            nFrames,
            nModes,
            layout.reference,
            layout.precision,
            layout.stencilSize,
            layout.nLearned,
            layout.nReused,
            layout.rests,
            layout.restBits,
          ],
          [
            block.frames,
            block.modes,
            block.reference,
            block.precision,
            block.stencil,
            block.learned,
            block.reused ?? 0,
            block.rests ?? [],
            block["rest bits"] ?? 0,
          ],
        );
        const coefficients = core.during((scope) => {
          const { codingOrder, parts } = buildHierarchy(core, connectivity, layout.stencilSize);
          const data = sections.get(Section.COEFFICIENTS);
          const nOwn = nModes - layout.nReused;
          const found = decodeFields(core, scope, data, nOwn, nVerts, () => codingOrder);
          const integers = core.int32s(found, nOwn * nVerts).slice();
          parts.forEach((part) => core.heap.give(part));
          return integers;
        });
        assert.equal(hashOf(coefficients), block["hash of coefficients"], name);
        if (block["n corrections"]) {
          const payload = sections.get(Section.CORRECTIONS);
          const step = new DataView(payload.buffer, payload.byteOffset).getFloat32(0, true);
          const found = readCorrections(core, payload, 3, nFrames, places);
          const rows = [];
          for (let t = 0; t < nFrames; t++) {
            for (let i = found.starts[t]; i < found.starts[t + 1]; i++) {
              const moves = found.moves.subarray(3 * i, 3 * i + 3);
              rows.push([found.vertices[i], t, ...moves.map((move) => Math.round(move / step))]);
            }
          }
          assert.equal(rows.length, block["n corrections"]);
          // Ordered by vertex, then frame; each is (frame, vertex, offsets).
          rows.sort(([u, s], [v, t]) => u - v || s - t);
          const integers = rows.flatMap(([vertex, frame, ...offsets]) => [
            frame,
            vertex,
            ...offsets,
          ]);
          assert.equal(hashOf(integers), block["hash of corrections"], name);
        }
      });
      core.heap.give(connectivity.internalFaces);
      assert.equal(core.heap.usedBytes, 0);
    }
  });

  test(`surfaces are those of every stream, by ${module}`, () => {
    for (const name of PLAYED) {
      const core = newCore(Core, module);
      const bytes = bytesOf(name);
      const wanted = said(name);
      const reel = new MemoryReel(core, bytes);
      const { surface, info } = reel;
      assert.equal(surface.faceSizes?.length ?? null, wanted.polygons, name);
      if (surface.faceSizes) assert.equal(hashOf(surface.faceSizes), wanted["hash of polygons"]);
      const polygons = new Polygons(surface.triangles, info.nVerts, surface.faceSizes);
      const hard = ascending(surface.hardEdges ?? []);
      assert.equal(hard.length / 2, wanted["hard edges"] ?? 0, name);
      if (hard.length) assert.equal(hashOf(hard), wanted["hash of hard edges"], name);
      const stored = readStream(bytes)
        .leading.filter((section) => section.id === Section.ATTRIBUTE)
        .map((section) => readAttribute(core, section.payload, polygons));
      assert.deepEqual(
        stored.map(({ name, kind, domain, width, table, rows }) => ({
          name,
          kind: kind === "texcoord" ? "uv" : kind,
          domain,
          type: LETTERS[table.constructor.name],
          width,
          "n rows": table.length / width,
          "hash of values": sha(table),
          "hash of rows": rows && hashOf(rows),
        })),
        wanted.attributes,
        name,
      );
      surface.attributes.forEach(({ values, width, domain }, i) => {
        const { table, rows } = stored[i];
        assert.equal(values.length, width * polygons.count(domain));
        const row = (rows?.at(-1) ?? table.length / width - 1) * width;
        assert.deepEqual(values.subarray(-width), table.subarray(row, row + width));
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
}

test("facts are those of every stream", () => {
  for (const name of PLAYED) {
    const wanted = said(name);
    const { info } = new MemoryReel(newCore(Core), bytesOf(name));
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

test("other methods are refused with what to do", () => {
  assert.ok(OTHERS.length >= 8);
  for (const name of OTHERS) {
    assert.throws(
      () => new MemoryReel(newCore(Core), bytesOf(name)),
      (error) =>
        error instanceof UnsupportedVersionError &&
        error.message.includes(said(name).method) &&
        error.message.includes("pages decode reel, lossless and grid: encode the original again"),
    );
  }
});

test("streams that break a rule of the format are refused", () => {
  const folder = new URL("../../conformance/refused/", import.meta.url);
  const names = readdirSync(folder);
  assert.ok(names.length >= 7);
  for (const name of names) {
    const core = newCore(Core, "reel");
    const data = new Uint8Array(readFileSync(new URL(name, folder)));
    const decode = () => new MemoryReel(core, data).decodeBlock(0);
    assert.throws(decode, { name: "CorruptStreamError" }, name);
  }
});
