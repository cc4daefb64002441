// Color maps are perceptually uniform, and ranges are estimated from few frames.

import assert from "node:assert/strict";
import { test } from "node:test";
import { loadModule } from "./three_modules.mjs";

const { centerAtZero, colorAt, createColorTexture, resolveColorMap } = await loadModule("color/color_map");
const { parseRange, resolveRange, selectColumns } = await loadModule("color/color_range");

/** Convert a color to OKLab, in which distances are perceptual. */
function labOf(color) {
  const [r, g, b] = color
    .map((one) => one / 255)
    .map((one) => (one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4));
  const l = Math.cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const m = Math.cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const s = Math.cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  return [
    0.2104542553 * l + 0.793617785 * m - 0.0040720468 * s,
    1.9779984951 * l - 2.428592205 * m + 0.4505937099 * s,
    0.0259040371 * l + 0.7827717662 * m - 0.808675766 * s,
  ];
}

/** OKLab colors of a map at evenly spaced positions. */
function sampleMap(map, count) {
  const colors = resolveColorMap(map);
  return Array.from({ length: count }, (_, i) => labOf(colorAt(colors, i / (count - 1))));
}

function distance(one, other) {
  return Math.hypot(...one.map((value, i) => value - other[i]));
}

test("the lightness of the sequential map increases evenly", () => {
  const labs = sampleMap("sequential", 17);
  const steps = labs.slice(1).map(([lightness], i) => lightness - labs[i][0]);
  assert.ok(Math.min(...steps) > 0.5 * (steps.reduce((sum, one) => sum + one) / steps.length));
});

test("the diverging map has even steps and is symmetric", () => {
  const labs = sampleMap("diverging", 17);
  const steps = labs.slice(1).map((one, i) => distance(one, labs[i]));
  assert.ok(Math.max(...steps) < 1.1 * Math.min(...steps));
  for (let i = 0; i < 8; i++) assert.ok(Math.abs(labs[i][0] - labs[16 - i][0]) < 0.01);
  assert.deepEqual(colorAt(resolveColorMap("diverging"), 0.5), [238, 238, 238]);
});

test("positions are clamped to the map, and NaN is gray", () => {
  const colors = resolveColorMap(["#000", "red", 0xffffff]);
  assert.deepEqual(colorAt(colors, -1), [0, 0, 0]);
  assert.deepEqual(colorAt(colors, 0.25), [128, 0, 0]);
  assert.deepEqual(colorAt(colors, 0.5), [255, 0, 0]);
  assert.deepEqual(colorAt(colors, 7), [255, 255, 255]);
  assert.deepEqual(colorAt(colors, NaN), [128, 128, 128]);
});

test("a texture has the colors in its first row, and gray in all others", () => {
  const { data, width, height } = createColorTexture(resolveColorMap("sequential")).image;
  assert.deepEqual([...data.subarray(0, 4)], [0x41, 0x2b, 0x78, 255]);
  assert.deepEqual([...data.subarray(4 * width - 4, 4 * width)], [0xfa, 0xf2, 0x5e, 255]);
  const rest = data.subarray(4 * width);
  assert.equal(rest.length, 4 * width * (height - 1));
  assert.ok(rest.every((one, i) => one === (i % 4 === 3 ? 255 : 128)));
});

/** A track with the given frames that records requests. */
function trackOf(frames, nColumns = 1) {
  const requested = [];
  const frame = async (index) => {
    requested.push(index);
    return frames[index];
  };
  return { info: { name: "track", nColumns, nItems: frames[0].length / nColumns }, frame, requested };
}

const { signal } = new AbortController();
const SINGLE_COLUMN = { columns: [0], as: "number" };
const FULL = parseRange("0%:100%");

/** Compute the range of a track with 30 frames, 22 of them in the first block. */
function rangeOf(track, ends, wholeFile = false, selection = SINGLE_COLUMN) {
  const blocks = [{ start: 0, nFrames: 22 }];
  return resolveRange(track, { blocks, nFrames: 30 }, selection, ends, wholeFile, signal);
}

test("percentiles use eight frames of the first block, including its ends", async () => {
  const frames = Array.from({ length: 30 }, (_, t) => [2 + t, 5]);
  const track = trackOf(frames);
  assert.deepEqual(await rangeOf(track, FULL), [2, 23]);
  assert.deepEqual(track.requested, [0, 3, 6, 9, 12, 15, 18, 21]);
  const one = { blocks: [{ start: 0, nFrames: 1 }], nFrames: 1 };
  assert.deepEqual(await resolveRange(track, one, SINGLE_COLUMN, FULL, false, signal), [2, 5]);
});

test("percentiles of the whole file use eight frames, or all for the extremes", async () => {
  const frames = Array.from({ length: 30 }, (_, t) => Float32Array.of(t, 10 * (t === 13)));
  const track = trackOf(frames);
  assert.deepEqual(await rangeOf(track, parseRange("40%:100%"), true), [0, 29]);
  assert.equal(track.requested.length, 30);
  const few = trackOf(frames);
  await rangeOf(few, parseRange("2%:98%"), true);
  assert.deepEqual(few.requested, [0, 4, 8, 12, 17, 21, 25, 29]);
});

test("percentiles are interpolated as in NumPy", async () => {
  const values = Float64Array.from({ length: 101 }, (_, i) => 100 - i);
  const alone = trackOf(Array.from({ length: 30 }, () => values));
  assert.deepEqual(await rangeOf(alone, parseRange("2%:98%")), [2, 98]);
  assert.deepEqual(await rangeOf(alone, parseRange("-7:50%")), [-7, 50]);
  await assert.rejects(rangeOf(alone, parseRange("50%:7")), /would be 50 to 7; set another one/);
});

test("percentiles of opposite sign become symmetric; explicit ends are kept", async () => {
  const of = (values, ends = FULL, selection = SINGLE_COLUMN, nColumns = 1) =>
    rangeOf(trackOf(Array(30).fill(values), nColumns), ends, false, selection);
  assert.deepEqual(await of([-1, 3]), [-3, 3]);
  assert.deepEqual(await of([-4, 3]), [-4, 4]);
  assert.deepEqual(await of([-4, 0]), [-4, 0]);
  assert.deepEqual(await of([-4, 3], parseRange([-1, 3])), [-1, 3]);
  assert.deepEqual(await of([NaN, 2, Infinity, 6]), [2, 6]);
  assert.deepEqual(await of([NaN]), [0, 1]);
  assert.deepEqual(await of([8, 8]), [4, 12]);
  assert.deepEqual(await of([0]), [-0.5, 0.5]);
  assert.deepEqual(await of(BigInt64Array.of(-(2n ** 40n), 2n)), [-(2 ** 40), 2 ** 40]);
  const length = { columns: [0, 1], as: "magnitude" };
  assert.deepEqual(await of([3, 4, -6, 8], FULL, length, 2), [5, 10]);
  assert.deepEqual(await of([3, 4, -6, 8], FULL, { columns: [1], as: "number" }, 2), [4, 8]);
});

test("values beyond 0 by less than the error bound do not count as the other sign", async () => {
  const of = (values, errorBound, kind = "scalar", ends = FULL) => {
    const track = trackOf(Array(30).fill(values));
    Object.assign(track.info, { errorBound, kind });
    return rangeOf(track, ends);
  };
  assert.deepEqual(await of([-0.01, 0.005, 7], 0.02), [0, 7]);
  assert.deepEqual(await of([-7, 0.005], 0.02), [-7, 0]);
  assert.deepEqual(await of([-0.01, 0.015], 0.02), [0, 0.02]);
  assert.deepEqual(await of([0, 0], 0.02), [0, 0.02]);
  assert.deepEqual(await of([-0.01, 7], 0.02, "scalar", parseRange("0%:5")), [0, 5]);
  assert.deepEqual(await of([-0.03, 7], 0.02), [-7, 7]);
  assert.deepEqual(await of([-0.01, 7], null), [-7, 7]);
  assert.deepEqual(await of([-0.01, 0.9], 2, "normal"), [-0.9, 0.9]); // the bound is an angle
  assert.deepEqual(await of([-0.01, 7], 0.02, "scalar", parseRange([-0.01, 7])), [-0.01, 7]);
});

test("a component selects a column, the magnitude or the color", () => {
  const select = (nColumns, component, kind = "other") =>
    selectColumns({ name: "u", kind, nColumns }, component);
  assert.deepEqual(select(1), SINGLE_COLUMN);
  assert.deepEqual(select(1, "magnitude"), { columns: [0], as: "magnitude" });
  assert.deepEqual(select(3), { columns: [0, 1, 2], as: "magnitude" });
  assert.deepEqual(select(3, "y"), { columns: [1], as: "number" });
  assert.deepEqual(select(9, 8), { columns: [8], as: "number" });
  assert.deepEqual(select(3, undefined, "normal"), { columns: [0], as: "number" });
  assert.deepEqual(select(4, undefined, "color"), { columns: [0, 1, 2], as: "color" });
  assert.deepEqual(select(4, 3, "color"), { columns: [3], as: "number" });
  for (const [nColumns, component] of [[4], [4, "magnitude"], [2, 2], [2, -1], [2, 0.5], [2, "z"]]) {
    assert.throws(() => select(nColumns, component), /component must be one of 0 to/);
  }
  assert.throws(() => select(2, "z"), { message: /one of 0 to 1, "x", "y", "magnitude"; got z/ });
});

test("a range is two numbers or percentiles in ascending order", () => {
  const number = (amount) => ({ amount, isPercent: false });
  assert.deepEqual(parseRange([-1, 2]), [number(-1), number(2)]);
  assert.deepEqual(parseRange("0:5e2"), [number(0), number(500)]);
  assert.deepEqual(parseRange(" 2% : 40"), [{ amount: 2, isPercent: true }, number(40)]);
  const wrong = [[1, 1], [2, 1], [NaN, 1], [0, Infinity], [1], [0, 1, 2]];
  for (const range of [...wrong, "", ":", "1:", "3", "9%:8%", "-1%:5", "0:101%", "a:b", "1:2:3"]) {
    assert.throws(() => parseRange(range), /range must be two finite numbers/, String(range));
  }
});

test("a diverging map keeps 0 at its middle for asymmetric ranges", () => {
  const colors = centerAtZero(resolveColorMap("diverging"), -1, 3);
  assert.deepEqual(colorAt(colors, 0.25).map((one) => Math.abs(one - 238) < 3), [true, true, true]);
  assert.deepEqual(colorAt(colors, 1), colorAt(resolveColorMap("diverging"), 1));
  assert.deepEqual(colorAt(colors, 0), colorAt(resolveColorMap("diverging"), 1 / 3));
});
