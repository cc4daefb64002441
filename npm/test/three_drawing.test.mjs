import assert from "node:assert/strict";
import { test } from "node:test";

import { loadModule } from "./three_modules.mjs";

const { createDrawing } = await loadModule("drawing");
const { computePositions, computeNormals } = await loadModule("cpu_frames");
const { loadMasks, maskIndex } = await loadModule("face_masks");

/** Two triangles of a square: 0 1 2 and 0 2 3. */
const TRIANGLES = Uint32Array.of(0, 1, 2, 0, 2, 3);

function surface(parts = {}) {
  const defaults = { faceSizes: null, triangleCorners: null, attributes: [], groups: [], materials: [], images: [] };
  return { triangles: TRIANGLES, ...defaults, hardEdges: null, ...parts };
}

function attribute(kind, domain, width, values, name = kind) {
  return { name, kind, domain, width, values };
}

/** Return the values of an attribute at each corner of each triangle. */
function atCorners(drawing, name) {
  const { width, values } = drawing.attributes.find((one) => one.name === name);
  return [...drawing.index].map((i) => [...values.slice(width * i, width * (i + 1))]);
}

test("vertices are not split by attributes of vertices", () => {
  const uv = Float32Array.of(0, 0, 1, 0, 1, 1, 0, 1);
  const drawing = createDrawing(surface({ attributes: [attribute("uv", "vertex", 2, uv)] }), 4);
  assert.deepEqual([...drawing.sources], [0, 1, 2, 3]);
  assert.equal(drawing.index, TRIANGLES);
  const [{ name, width, values }] = drawing.attributes;
  assert.deepEqual([name, width, values], ["uv", 2, uv]);
  assert.deepEqual([drawing.groups, drawing.order], [[], null]);
});

test("a vertex is split only where values of corners differ", () => {
  const uv = Float32Array.of(0, 0, 1, 0, 1, 1, 0, 0, 0.5, 0.5, 0, 1);
  const drawing = createDrawing(surface({ attributes: [attribute("uv", "corner", 2, uv)] }), 4);
  assert.deepEqual([...drawing.sources].sort(), [0, 1, 2, 2, 3]);
  assert.deepEqual([...drawing.index].map((i) => drawing.sources[i]), [...TRIANGLES]);
  assert.deepEqual(atCorners(drawing, "uv").flat(), [...uv]);
});

test("attributes of polygons and their corners are assigned to triangles", () => {
  const corners = Float32Array.of(10, 0, 11, 0, 12, 0, 13, 0, 20, 0, 21, 0, 22, 0);
  const drawing = createDrawing(
    surface({
      triangles: Uint32Array.of(0, 1, 2, 0, 2, 3, 3, 2, 4),
      faceSizes: Uint32Array.of(4, 3),
      triangleCorners: Uint32Array.of(0, 1, 2, 0, 2, 3, 4, 5, 6),
      attributes: [
        attribute("uv", "corner", 2, corners),
        attribute("color", "face", 3, Uint8Array.of(255, 0, 0, 0, 255, 0)),
      ],
    }),
    5,
  );
  const us = atCorners(drawing, "uv").map(([u]) => u);
  assert.deepEqual(us, [10, 11, 12, 10, 12, 13, 20, 21, 22]);
  const greens = atCorners(drawing, "color").map(([, green]) => green);
  assert.deepEqual(greens, [0, 0, 0, 0, 0, 0, 1, 1, 1]);
});

test("colors are converted from sRGB to linear", () => {
  const colors = Uint8Array.of(188, 188, 188, 255, 0, 0, 0, 10, 255, 0, 0, 0);
  const drawing = createDrawing(surface({ attributes: [attribute("color", "vertex", 3, colors)] }), 4);
  const [gray] = atCorners(drawing, "color");
  assert.ok(Math.abs(gray[0] - 0.5029) < 1e-3);
  const alpha = Float32Array.from({ length: 16 }, (_, i) => (i % 4 === 3 ? 0.5 : 0.25));
  const withAlpha = createDrawing(surface({ attributes: [attribute("color", "vertex", 4, alpha)] }), 4);
  assert.equal(atCorners(withAlpha, "color")[0][3], 0.5);
  const shades = Float32Array.of(1, 0, NaN, 2);
  const grays = createDrawing(surface({ attributes: [attribute("color", "vertex", 1, shades)] }), 4);
  assert.deepEqual([...grays.attributes[0].values], [1, 1, 1, 0, 0, 0, 0, 0, 0, 1, 1, 1]);
});

test("the first four UV sets are assigned to three.js channels", () => {
  const uvs = ["a", "b", "c", "d", "e"].map((name) =>
    attribute("uv", "vertex", 2, new Float32Array(8), name),
  );
  const drawing = createDrawing(surface({ attributes: uvs }), 4);
  assert.deepEqual(drawing.uvNames, ["a", "b", "c", "d"]);
  assert.deepEqual(drawing.attributes.map(({ name }) => name), ["uv", "uv1", "uv2", "uv3"]);
});

test("triangles are sorted by material", () => {
  const groups = [
    { name: "part", labels: ["x"], faceLabels: Int32Array.of(0, 0, 0, 0) },
    { name: "material", labels: ["red", "blue", "unused"], faceLabels: Int32Array.of(1, -1, 0, 1) },
  ];
  const triangles = Uint32Array.of(0, 1, 2, 1, 2, 3, 2, 3, 4, 3, 4, 5);
  const drawing = createDrawing(surface({ triangles, groups }), 6);
  assert.deepEqual([...drawing.index], [2, 3, 4, 0, 1, 2, 3, 4, 5, 1, 2, 3]);
  assert.deepEqual([...drawing.order], [2, 0, 3, 1]);
  assert.deepEqual(drawing.groups, [
    { start: 0, count: 3, materialIndex: 0 },
    { start: 3, count: 6, materialIndex: 1 },
    { start: 9, count: 3, materialIndex: 3 },
  ]);
  assert.deepEqual(drawing.materialNames, ["red", "blue", "unused", null]);
});

test("splitting one vertex into many takes linear time", () => {
  const count = 100_000;
  const triangles = Uint32Array.from({ length: 3 * count }, (_, i) => (i % 3 ? i % 3 : 0));
  const uv = Float32Array.from({ length: 6 * count }, (_, i) => i);
  const start = performance.now();
  const drawing = createDrawing(
    surface({ triangles, attributes: [attribute("uv", "corner", 2, uv)] }),
    3,
  );
  assert.equal(drawing.sources.length, 3 * count);
  assert.ok(performance.now() - start < 2000);
});

const { meanPosition, composePicture, withoutFields } = await loadModule("loaded_block");

/** A block with two modes and three vertices; the second frame corrects vertex 1. */
const BLOCK = withoutFields({
  nFrames: 2,
  nModes: 2,
  nVerts: 3,
  means: Float64Array.of(2, 20),
  weights: Float32Array.of(1, 0, 0, 0, 1, 0, 2, 0, 0, 0, 0, 1),
  correctionStarts: Uint32Array.of(0, 0, 1),
  correctionVertices: Uint32Array.of(1),
  correctionOffsets: Float32Array.of(0.5, 0.25, 0),
});
const FIELDS = Int16Array.of(1, 2, 3, 10, 20, 30);

function positions(t, nextT, fraction, next = BLOCK) {
  const moment = { block: BLOCK, t, next, nextT, fraction };
  return [...computePositions(composePicture(moment), () => FIELDS, [100, 0, 0], new Float32Array(9))];
}

test("positions are sums of fields, corrections and the shift", () => {
  assert.deepEqual(positions(0, 0, 0), [101, 10, 0, 102, 20, 0, 103, 30, 0]);
  assert.deepEqual(positions(1, 1, 0), [102, 0, 10, 104.5, 0.25, 20, 106, 0, 30]);
});

test("positions are interpolated within a block and between blocks", () => {
  const between = [101.5, 5, 5, 103.25, 10.125, 10, 104.5, 15, 15];
  assert.deepEqual(positions(0, 1, 0.5), between);
  assert.deepEqual(positions(0, 1, 0.5, { ...BLOCK }), between);
});

test("the mean position ignores corrections", () => {
  const moment = { block: BLOCK, t: 0, next: BLOCK, nextT: 1, fraction: 0.5 };
  assert.deepEqual(meanPosition(composePicture(moment)), [3, 10, 10]);
});

test("normals are weighted by the areas of the faces around a vertex", () => {
  const points = Float32Array.of(0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0, 1, 9, 9, 9);
  const triangles = Uint32Array.of(0, 1, 2, 0, 3, 1); // areas 1.5 along z, 1.5 along y
  const normals = computeNormals(points, triangles, new Float32Array(15));
  const half = Math.fround(Math.SQRT1_2);
  assert.deepEqual([...normals.slice(0, 3)], [0, half, half]);
  assert.deepEqual([...normals.slice(6, 9)], [0, 0, 1]);
  assert.deepEqual([...normals.slice(12)], [0, 0, 1]); // without faces
});

/** Quads of a box with vertex x + 2 y + 4 z at (x, y, z). */
const BOX = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
const BOX_TRIANGLES = Uint32Array.from(BOX.flatMap(([a, b, c, d]) => [a, b, c, a, c, d]));
const BOX_EDGES = [[0, 1], [0, 2], [0, 4], [1, 3], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 6]];

function box(edges) {
  const hardEdges = Uint32Array.from(edges.flat());
  const faceSizes = Uint32Array.from(BOX, (quad) => quad.length);
  const triangleCorners = Uint32Array.from({ length: 36 }, (_, i) =>
    4 * Math.floor(i / 6) + [0, 1, 2, 0, 2, 3][i % 6]);
  return surface({ triangles: BOX_TRIANGLES, faceSizes, triangleCorners, hardEdges });
}

test("a vertex is split at hard edges, where faces have separate normals", () => {
  const drawing = createDrawing(box([...BOX_EDGES, [5, 7], [6, 7]]), 8);
  assert.equal(drawing.sources.length, 24);
  assert.deepEqual(drawing.attributes, []);
  assert.deepEqual([...drawing.index].map((i) => drawing.sources[i]), [...BOX_TRIANGLES]);
  const { nRows, cornerRows } = drawing;
  assert.deepEqual([...drawing.index].map((i) => drawing.rows[i]), [...cornerRows]);
  const positions = Float32Array.from({ length: 24 }, (_, i) => (i / 3 >> i % 3) & 1);
  const normals = computeNormals(positions, BOX_TRIANGLES, new Float32Array(3 * nRows), cornerRows);
  const axes = [[0, 0, -1], [0, 0, 1], [0, -1, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0]];
  drawing.index.forEach((i, corner) => {
    const row = drawing.rows[i];
    const found = [...normals.slice(3 * row, 3 * row + 3)].map((one) => one + 0);
    assert.deepEqual(found, axes[Math.floor(corner / 6)]);
  });
});

test("faces share normals across smooth edges and at the ends of open hard edges", () => {
  const one = createDrawing(box([[0, 1]]), 8);
  assert.equal(one.sources.length, 8);
  const rim = createDrawing(box([[0, 1], [1, 3], [2, 3], [0, 2]]), 8);
  assert.equal(rim.sources.length, 12);
  const bottom = [...rim.index.slice(0, 6)];
  assert.ok([...rim.index.slice(6)].every((vertex) => !bottom.includes(vertex)));
});

test("hard edges, UVs and split corners can be combined", () => {
  const uv = Float32Array.from({ length: 48 }, (_, i) => i % 7);
  const input = { ...box(BOX_EDGES), attributes: [attribute("uv", "corner", 2, uv)] };
  const drawing = createDrawing(input, 8, "corner");
  assert.equal(drawing.sources.length, 24);
  assert.deepEqual(drawing.attributes.map(({ name }) => name), ["uv"]);
  assert.deepEqual([...drawing.items], [...drawing.items.keys()]);
});

test("triangles of hidden polygons collapse in the ranges of their materials", () => {
  const shape = surface({
    triangles: Uint32Array.of(0, 1, 2, 0, 2, 3, 3, 2, 4),
    faceSizes: Uint32Array.of(4, 3),
    groups: [{ name: "material", labels: ["a", "b"], faceLabels: Int32Array.of(1, 0) }],
  });
  const drawing = createDrawing(shape, 5);
  assert.deepEqual([...drawing.order], [2, 0, 1]);
  const index = drawing.index.slice();
  maskIndex(drawing, shape, [Uint8Array.of(0, 1), Uint8Array.of(1, 1)], index);
  assert.deepEqual([...index], [3, 2, 4, 0, 0, 0, 0, 0, 0]);
  maskIndex(drawing, shape, [Uint8Array.of(1, 1), Uint8Array.of(1, 0)], index);
  assert.deepEqual([...index], [3, 3, 3, 0, 1, 2, 0, 2, 3]);
  maskIndex(drawing, shape, [Uint8Array.of(1, 1)], index);
  assert.deepEqual(index, drawing.index);
});

test("masks are tracks of faces with one number", async () => {
  const track = { domain: "face", nColumns: 1 };
  const tracks = [
    { ...track, name: "alive" },
    { ...track, name: "stress" },
    { ...track, name: "scanned", domain: "vertex" },
  ];
  const reel = {
    info: { tracks, blocks: [{ start: 0, nFrames: 5 }, { start: 5, nFrames: 2 }] },
    track: (name) => ({ frame: async (number) => [name, number] }),
  };
  const { signal } = new AbortController();
  assert.deepEqual(await loadMasks(reel, 1, signal), [[["alive", 5]], [["alive", 6]]]);
  reel.info.tracks = tracks.slice(1);
  assert.equal(await loadMasks(reel, 1, signal), null);
});
