// Colours of tracks: maps that look even, and ranges that follow from a few frames.

import assert from "node:assert/strict";
import { test } from "node:test";
import { moduleOf } from "./three_modules.mjs";

const { colorAt, colorsOf, textureOf } = await moduleOf("color/color_map");
const { checkedRange, sampledRange, shownOf } = await moduleOf("color/color_range");

/** Lightness, and two coordinates of hue: OKLab, in which distances are as they look. */
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

/** Looks of a map at places that are evenly apart. */
function looksOf(map, count) {
  const colors = colorsOf(map);
  return Array.from({ length: count }, (_, i) => labOf(colorAt(colors, i / (count - 1))));
}

function distance(one, other) {
  return Math.hypot(...one.map((value, i) => value - other[i]));
}

test("the sequential map gets lighter evenly", () => {
  const looks = looksOf("sequential", 17);
  const steps = looks.slice(1).map(([lightness], i) => lightness - looks[i][0]);
  assert.ok(Math.min(...steps) > 0.5 * (steps.reduce((sum, one) => sum + one) / steps.length));
});

test("the diverging map has even steps, and is alike to both sides", () => {
  const looks = looksOf("diverging", 17);
  const steps = looks.slice(1).map((one, i) => distance(one, looks[i]));
  assert.ok(Math.max(...steps) < 1.1 * Math.min(...steps));
  for (let i = 0; i < 8; i++) assert.ok(Math.abs(looks[i][0] - looks[16 - i][0]) < 0.01);
  assert.deepEqual(colorAt(colorsOf("diverging"), 0.5), [238, 238, 238]);
});

test("places outside have the colours of the ends, and NaN is grey", () => {
  const colors = colorsOf(["#000", "red", 0xffffff]);
  assert.deepEqual(colorAt(colors, -1), [0, 0, 0]);
  assert.deepEqual(colorAt(colors, 0.25), [128, 0, 0]);
  assert.deepEqual(colorAt(colors, 0.5), [255, 0, 0]);
  assert.deepEqual(colorAt(colors, 7), [255, 255, 255]);
  assert.deepEqual(colorAt(colors, NaN), [128, 128, 128]);
});

test("a texture has the colours in its first row, and grey in all others", () => {
  const { data, width, height } = textureOf(colorsOf("sequential")).image;
  assert.deepEqual([...data.subarray(0, 4)], [0x41, 0x2b, 0x78, 255]);
  assert.deepEqual([...data.subarray(4 * width - 4, 4 * width)], [0xfa, 0xf2, 0x5e, 255]);
  const rest = data.subarray(4 * width);
  assert.equal(rest.length, 4 * width * (height - 1));
  assert.ok(rest.every((one, i) => one === (i % 4 === 3 ? 255 : 128)));
});

/** A track of frames that are given, which notes which of them were asked for. */
function trackOf(frames, nColumns = 1) {
  const asked = [];
  const frame = async (number) => {
    asked.push(number);
    return frames[number];
  };
  return { info: { name: "track", nColumns }, frame, asked };
}

const { signal } = new AbortController();
const ALONE = { columns: [0], isMagnitude: false };

test("a range follows from eight frames of the first block, its ends among them", async () => {
  const frames = Array.from({ length: 30 }, (_, t) => [2 + t, 5]);
  const track = trackOf(frames);
  assert.deepEqual(await sampledRange(track, { start: 0, nFrames: 22 }, ALONE, signal), [2, 23]);
  assert.deepEqual(track.asked, [0, 3, 6, 9, 12, 15, 18, 21]);
  const short = trackOf(frames);
  assert.deepEqual(await sampledRange(short, { start: 0, nFrames: 1 }, ALONE, signal), [2, 5]);
  assert.deepEqual(short.asked, [0]);
});

test("a range is as far on both sides of 0 where there are numbers on both", async () => {
  const rangeOf = (values, shown = ALONE, nColumns = 1) =>
    sampledRange(trackOf([values], nColumns), { start: 0, nFrames: 1 }, shown, signal);
  assert.deepEqual(await rangeOf([-1, 3]), [-3, 3]);
  assert.deepEqual(await rangeOf([-4, 3]), [-4, 4]);
  assert.deepEqual(await rangeOf([-4, 0]), [-4, 0]);
  assert.deepEqual(await rangeOf([NaN, 2, Infinity, 6]), [2, 6]);
  assert.deepEqual(await rangeOf([NaN]), [0, 1]);
  assert.deepEqual(await rangeOf([8, 8]), [4, 12]);
  assert.deepEqual(await rangeOf([0]), [-0.5, 0.5]);
  const length = { columns: [0, 1], isMagnitude: true };
  assert.deepEqual(await rangeOf([3, 4, -6, 8], length, 2), [5, 10]);
  assert.deepEqual(await rangeOf([3, 4, -6, 8], { columns: [1], isMagnitude: false }, 2), [4, 8]);
});

test("what is shown of a value is its column or its length", () => {
  const shown = (nColumns, component) => shownOf({ name: "u", nColumns }, component);
  assert.deepEqual(shown(1), ALONE);
  assert.deepEqual(shown(1, "magnitude"), { columns: [0], isMagnitude: true });
  assert.deepEqual(shown(3), { columns: [0, 1, 2], isMagnitude: true });
  assert.deepEqual(shown(9, 8), { columns: [8], isMagnitude: false });
  for (const [nColumns, component] of [[4], [4, "magnitude"], [2, 2], [2, -1], [2, 0.5], [2, "x"]]) {
    assert.throws(() => shown(nColumns, component), /component must be one of 0 to/);
  }
});

test("a range is two finite numbers, the first less than the second", () => {
  assert.deepEqual(checkedRange([-1, 2]), [-1, 2]);
  for (const range of [[1, 1], [2, 1], [NaN, 1], [0, Infinity], [1], [0, 1, 2]]) {
    assert.throws(() => checkedRange(range), /range must be two finite numbers/);
  }
});
