import assert from "node:assert/strict";
import { test } from "node:test";

import { moduleOf } from "./three_modules.mjs";

const { drawingOf } = await moduleOf("drawing");
const { positionsOf, normalsOf } = await moduleOf("cpu_frames");

/** Two triangles of a square: 0 1 2 and 0 2 3. */
const TRIANGLES = Uint32Array.of(0, 1, 2, 0, 2, 3);

function surface(parts = {}) {
  const nothing = { faceSizes: null, attributes: [], groups: [], materials: [], images: [] };
  return { triangles: TRIANGLES, ...nothing, hardEdges: null, ...parts };
}

function attribute(kind, domain, width, values, name = kind) {
  return { name, kind, domain, width, values };
}

/** Values of an attribute at each corner of each triangle. */
function atCorners(drawing, name) {
  const { width, values } = drawing.attributes.find((one) => one.name === name);
  return [...drawing.index].map((i) => [...values.slice(width * i, width * (i + 1))]);
}

test("vertices stay as they are when only they have values", () => {
  const uv = Float32Array.of(0, 0, 1, 0, 1, 1, 0, 1);
  const drawing = drawingOf(surface({ attributes: [attribute("uv", "vertex", 2, uv)] }), 4);
  assert.deepEqual([...drawing.sources], [0, 1, 2, 3]);
  assert.equal(drawing.index, TRIANGLES);
  assert.deepEqual(drawing.attributes, [{ name: "uv", width: 2, values: uv }]);
  assert.deepEqual([drawing.groups, drawing.order], [[], null]);
});

test("a vertex is split where corners have different values, and only there", () => {
  const uv = Float32Array.of(0, 0, 1, 0, 1, 1, 0, 0, 0.5, 0.5, 0, 1);
  const drawing = drawingOf(surface({ attributes: [attribute("uv", "corner", 2, uv)] }), 4);
  assert.deepEqual([...drawing.sources].sort(), [0, 1, 2, 2, 3]);
  assert.deepEqual([...drawing.index].map((i) => drawing.sources[i]), [...TRIANGLES]);
  assert.deepEqual(atCorners(drawing, "uv").flat(), [...uv]);
});

test("values of polygons and their corners reach the fans of triangles", () => {
  const corners = Float32Array.of(10, 0, 11, 0, 12, 0, 13, 0, 20, 0, 21, 0, 22, 0);
  const drawing = drawingOf(
    surface({
      triangles: Uint32Array.of(0, 1, 2, 0, 2, 3, 3, 2, 4),
      faceSizes: Uint32Array.of(4, 3),
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

test("colours are turned from those of screens to light", () => {
  const colors = Uint8Array.of(188, 188, 188, 255, 0, 0, 0, 10, 255, 0, 0, 0);
  const drawing = drawingOf(surface({ attributes: [attribute("color", "vertex", 3, colors)] }), 4);
  const [gray] = atCorners(drawing, "color");
  assert.ok(Math.abs(gray[0] - 0.5029) < 1e-3);
  const alpha = Float32Array.from({ length: 16 }, (_, i) => (i % 4 === 3 ? 0.5 : 0.25));
  const seen = drawingOf(surface({ attributes: [attribute("color", "vertex", 4, alpha)] }), 4);
  assert.equal(atCorners(seen, "color")[0][3], 0.5);
  const shades = Float32Array.of(1, 0, NaN, 2);
  const greys = drawingOf(surface({ attributes: [attribute("color", "vertex", 1, shades)] }), 4);
  assert.deepEqual([...greys.attributes[0].values], [1, 1, 1, 0, 0, 0, 0, 0, 0, 1, 1, 1]);
});

test("the first four sets of texture coordinates are those of three.js", () => {
  const uvs = ["a", "b", "c", "d", "e"].map((name) =>
    attribute("uv", "vertex", 2, new Float32Array(8), name),
  );
  const drawing = drawingOf(surface({ attributes: uvs }), 4);
  assert.deepEqual(drawing.uvNames, ["a", "b", "c", "d"]);
  assert.deepEqual(drawing.attributes.map(({ name }) => name), ["uv", "uv1", "uv2", "uv3"]);
});

test("triangles of one material follow one another", () => {
  const groups = [
    { name: "part", labels: ["x"], ofFace: Int32Array.of(0, 0, 0, 0) },
    { name: "material", labels: ["red", "blue", "unused"], ofFace: Int32Array.of(1, -1, 0, 1) },
  ];
  const triangles = Uint32Array.of(0, 1, 2, 1, 2, 3, 2, 3, 4, 3, 4, 5);
  const drawing = drawingOf(surface({ triangles, groups }), 6);
  assert.deepEqual([...drawing.index], [2, 3, 4, 0, 1, 2, 3, 4, 5, 1, 2, 3]);
  assert.deepEqual([...drawing.order], [2, 0, 3, 1]);
  assert.deepEqual(drawing.groups, [
    { start: 0, count: 3, materialIndex: 0 },
    { start: 3, count: 6, materialIndex: 1 },
    { start: 9, count: 3, materialIndex: 3 },
  ]);
  assert.deepEqual(drawing.materialNames, ["red", "blue", "unused", null]);
});

test("a vertex with many different values takes no more time than many vertices", () => {
  const count = 100_000;
  const triangles = Uint32Array.from({ length: 3 * count }, (_, i) => (i % 3 ? i % 3 : 0));
  const uv = Float32Array.from({ length: 6 * count }, (_, i) => i);
  const start = performance.now();
  const drawing = drawingOf(
    surface({ triangles, attributes: [attribute("uv", "corner", 2, uv)] }),
    3,
  );
  assert.equal(drawing.sources.length, 3 * count);
  assert.ok(performance.now() - start < 2000);
});

const { middleOf, pictureOf } = await moduleOf("held_block");

/** Two modes and three vertices; the second frame has a correction of vertex 1. */
const BLOCK = {
  nModes: 2,
  nBlockModes: 2,
  nVerts: 3,
  means: Float64Array.of(2, 20),
  meanWeights: Float32Array.of(1.5, 0, 0, 0, 0.5, 0.5),
  weights: Float32Array.of(1, 0, 0, 0, 1, 0, 2, 0, 0, 0, 0, 1),
  correctionStarts: Uint32Array.of(0, 0, 1),
  correctionVertices: Uint32Array.of(1),
  correctionOffsets: Float32Array.of(0.5, 0.25, 0),
};
const FIELDS = Int16Array.of(1, 2, 3, 10, 20, 30);

function positions(t, nextT, fraction, next = BLOCK, nMoving = Infinity) {
  const moment = { block: BLOCK, t, next, nextT, fraction, nMoving };
  return [...positionsOf(pictureOf(moment), () => FIELDS, [100, 0, 0], new Float32Array(9))];
}

test("positions are sums of fields, corrections and the shift", () => {
  assert.deepEqual(positions(0, 0, 0), [101, 10, 0, 102, 20, 0, 103, 30, 0]);
  assert.deepEqual(positions(1, 1, 0), [102, 0, 10, 104.5, 0.25, 20, 106, 0, 30]);
});

test("positions between frames are on the way, in a block and from one to the next", () => {
  const between = [101.5, 5, 5, 103.25, 10.125, 10, 104.5, 15, 15];
  assert.deepEqual(positions(0, 1, 0.5), between);
  assert.deepEqual(positions(0, 1, 0.5, { ...BLOCK }), between);
});

test("modes rest at their mean, and nothing is corrected, where fewer move than there are", () => {
  assert.deepEqual(positions(1, 1, 0, BLOCK, 1), [102, 5, 5, 104, 10, 10, 106, 15, 15]);
  assert.deepEqual(positions(1, 1, 0, BLOCK, 2), positions(1, 1, 0));
});

test("the middle is the mean of the vertices that are not corrected", () => {
  const moment = { block: BLOCK, t: 0, next: BLOCK, nextT: 1, fraction: 0.5, nMoving: Infinity };
  assert.deepEqual(middleOf(pictureOf(moment)), [3, 10, 10]);
  assert.deepEqual(middleOf(pictureOf({ ...moment, fraction: 0, nMoving: 1 })), [2, 10, 10]);
});

test("normals are of the faces around each vertex, by their areas", () => {
  const points = Float32Array.of(0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0, 1, 9, 9, 9);
  const triangles = Uint32Array.of(0, 1, 2, 0, 3, 1); // areas 1.5 along z, 1.5 along y
  const normals = normalsOf(points, triangles, new Float32Array(15));
  const half = Math.fround(Math.SQRT1_2);
  assert.deepEqual([...normals.slice(0, 3)], [0, half, half]);
  assert.deepEqual([...normals.slice(6, 9)], [0, 0, 1]);
  assert.deepEqual([...normals.slice(12)], [0, 0, 1]); // of no face
});

/** Quads of a box, whose vertex x + 2 y + 4 z is at (x, y, z), as fans. */
const BOX = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
const BOX_TRIANGLES = Uint32Array.from(BOX.flatMap(([a, b, c, d]) => [a, b, c, a, c, d]));
const BOX_EDGES = [[0, 1], [0, 2], [0, 4], [1, 3], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 6]];

function box(edges) {
  const hardEdges = Uint32Array.from(edges.flat());
  const faceSizes = Uint32Array.from(BOX, (quad) => quad.length);
  return surface({ triangles: BOX_TRIANGLES, faceSizes, hardEdges });
}

test("a vertex is split at hard edges, and faces have normals of their own there", () => {
  const drawing = drawingOf(box([...BOX_EDGES, [5, 7], [6, 7]]), 8);
  assert.equal(drawing.sources.length, 24);
  assert.deepEqual(drawing.attributes, []);
  assert.deepEqual([...drawing.index].map((i) => drawing.sources[i]), [...BOX_TRIANGLES]);
  const { vertices, triangles } = drawing.shading;
  assert.deepEqual([...triangles].map((row) => vertices[row]), [...BOX_TRIANGLES]);
  assert.deepEqual([...drawing.rows].map((row) => vertices[row]), [...drawing.sources]);
  const positions = Float32Array.from({ length: 24 }, (_, i) => (i / 3 >> i % 3) & 1);
  const normals = normalsOf(positions, BOX_TRIANGLES, new Float32Array(72), triangles);
  const axes = [[0, 0, -1], [0, 0, 1], [0, -1, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0]];
  drawing.index.forEach((i, corner) => {
    const row = drawing.rows[i];
    const found = [...normals.slice(3 * row, 3 * row + 3)].map((one) => one + 0);
    assert.deepEqual(found, axes[Math.floor(corner / 6)]);
  });
});

test("faces share a normal around an edge that ends inside, and across edges that are not hard", () => {
  const one = drawingOf(box([[0, 1]]), 8);
  assert.equal(one.sources.length, 8);
  const rim = drawingOf(box([[0, 1], [1, 3], [2, 3], [0, 2]]), 8);
  assert.equal(rim.sources.length, 12);
  const bottom = [...rim.index.slice(0, 6)];
  assert.ok([...rim.index.slice(6)].every((vertex) => !bottom.includes(vertex)));
});

test("hard edges, texture coordinates and split corners go together", () => {
  const uv = Float32Array.from({ length: 48 }, (_, i) => i % 7);
  const given = { ...box(BOX_EDGES), attributes: [attribute("uv", "corner", 2, uv)] };
  const drawing = drawingOf(given, 8, "corner");
  assert.equal(drawing.sources.length, 24);
  assert.deepEqual(drawing.attributes.map(({ name }) => name), ["uv"]);
  assert.deepEqual([...drawing.items], [...drawing.items.keys()]);
});
