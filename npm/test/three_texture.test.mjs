import assert from "node:assert/strict";
import { test } from "node:test";

import { loadModule } from "./three_modules.mjs";

const { commonLength, frameAtTime, seekTime } = await loadModule("texture/frame_times");
const { cellsSize, checkFrameNumber, readFrameNumber } = await loadModule("texture/frame_number");

const CODE = { x: 0, y: 0, cell: 8, bits: 5 };

/** Render cells with the given gray levels, 0..255. */
function renderCells(levels, { cell } = CODE) {
  const pixels = new Uint8ClampedArray(4 * cell * cell * levels.length).fill(255);
  for (let i = 0; i < pixels.length; i++) {
    const level = levels[Math.floor(i / 4 / cell) % levels.length];
    if (i % 4 < 3) pixels[i] = level;
  }
  return pixels;
}

/** Encode a number as gray levels of cells. */
function encodeLevels(number, { bits } = CODE) {
  const text = number.toString(2).padStart(bits, "0");
  const isEven = [...text].filter((one) => one === "1").length % 2 === 0;
  return [...text, isEven ? "1" : "0"].map((one) => 255 * Number(one));
}

test("times rounded to milliseconds yield the right frame", () => {
  for (const fps of [12, 23.976, 24, 25, 29.97, 30, 50, 59.94, 60, 120]) {
    for (const rounded of [Math.round, Math.floor, Math.ceil]) {
      for (let frame = 0; frame < 2000; frame++) {
        assert.equal(frameAtTime(rounded((1000 * frame) / fps) / 1000, fps), frame);
      }
    }
  }
});

test("times between two frames yield fractional positions", () => {
  assert.equal(frameAtTime(0.5 / 30, 30), 0.5);
  assert.equal(frameAtTime(7.25 / 24, 24), 7.25);
});

test("times before the first frame yield the first frame", () => {
  assert.equal(frameAtTime(-0.3, 30), 0);
});

test("seek times are inside of the frame", () => {
  for (const fps of [24, 29.97, 30]) {
    for (let frame = 0; frame < 500; frame++) {
      for (const videoFps of [fps, 2 * fps]) {
        const shown = Math.floor(seekTime(frame, fps) * videoFps);
        assert.equal(Math.floor(shown * (fps / videoFps)), frame);
      }
    }
  }
});

test("seek times of fractional positions are between frames", () => {
  assert.equal(seekTime(3.5, 10), 0.35);
  assert.equal(seekTime(3.999, 10), 0.375);
});

test("a difference of one frame causes no warning", () => {
  assert.deepEqual(commonLength(90, 30, 3.03), { nFrames: 90, warning: null });
  assert.deepEqual(commonLength(90, 30, 2.967), { nFrames: 89, warning: null });
});

test("the common length is played if one is longer", () => {
  const longer = commonLength(90, 30, 4);
  assert.equal(longer.nFrames, 90);
  assert.match(longer.warning, /3\.00 s.*4\.00 s.*first 3\.00 s are played.*end of the video/);
  const shorter = commonLength(90, 30, 2);
  assert.equal(shorter.nFrames, 60);
  assert.match(shorter.warning, /first 2\.00 s are played.*end of the mesh/);
});

test("the whole mesh is played if the duration of the video is unknown", () => {
  assert.deepEqual(commonLength(90, 30, Infinity), { nFrames: 90, warning: null });
  assert.deepEqual(commonLength(90, 30, NaN), { nFrames: 90, warning: null });
});

test("one frame is played if the video ends before the offset", () => {
  assert.equal(commonLength(90, 30, -1).nFrames, 1);
});

test("all numbers are read correctly", () => {
  for (let number = 0; number < 2 ** CODE.bits; number++) {
    assert.equal(readFrameNumber(renderCells(encodeLevels(number)), CODE), number);
  }
});

test("numbers are read with limited video range", () => {
  const levels = encodeLevels(19).map((level) => 16 + (level * 219) / 255);
  assert.equal(readFrameNumber(renderCells(levels), CODE), 19);
});

test("no number is read if one cell is inverted", () => {
  for (let number = 0; number < 2 ** CODE.bits; number++) {
    for (let cell = 0; cell <= CODE.bits; cell++) {
      const levels = encodeLevels(number);
      levels[cell] = 255 - levels[cell];
      assert.equal(readFrameNumber(renderCells(levels), CODE), null);
    }
  }
});

test("no number is read if a cell is gray", () => {
  const levels = encodeLevels(5);
  levels[2] = 128;
  assert.equal(readFrameNumber(renderCells(levels), CODE), null);
});

test("no number is read from a black image", () => {
  assert.equal(readFrameNumber(renderCells(Array(6).fill(0)), CODE), null);
});

test("blurred edges of cells are ignored", () => {
  const levels = encodeLevels(22);
  const pixels = renderCells(levels);
  const { width, height } = cellsSize(CODE);
  for (let i = 0; i < width * height; i++) {
    const [x, y] = [(i % width) % CODE.cell, Math.floor(i / width)];
    if (Math.min(x, y, CODE.cell - 1 - x, CODE.cell - 1 - y) < 2) pixels.fill(128, 4 * i, 4 * i + 3);
  }
  assert.equal(readFrameNumber(pixels, CODE), 22);
});

test("invalid layouts of cells are rejected", () => {
  const wrong = [{ x: -1 }, { y: 0.5 }, { cell: 3 }, { bits: 0 }, { bits: 31 }, { cell: NaN }];
  for (const one of wrong) {
    assert.throws(() => checkFrameNumber({ ...CODE, ...one }), {
      name: "InvalidInputError",
      message: /frameNumber must have integers x >= 0, y >= 0, cell >= 4 and bits from 1 to 30/,
    });
  }
  checkFrameNumber(CODE);
});
