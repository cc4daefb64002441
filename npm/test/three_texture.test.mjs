import assert from "node:assert/strict";
import { test } from "node:test";

import { moduleOf } from "./three_modules.mjs";

const { commonOf, placeOf, timeOf } = await moduleOf("texture/frame_times");
const { checkFrameNumber, numberIn, sizeOf } = await moduleOf("texture/frame_number");

const CODE = { x: 0, y: 0, cell: 8, bits: 5 };

/** Pixels of a row of cells of these levels of grey, 0 to 255. */
function cellsOf(levels, { cell } = CODE) {
  const pixels = new Uint8ClampedArray(4 * cell * cell * levels.length).fill(255);
  for (let i = 0; i < pixels.length; i++) {
    const level = levels[Math.floor(i / 4 / cell) % levels.length];
    if (i % 4 < 3) pixels[i] = level;
  }
  return pixels;
}

/** Levels of the cells of a number, as frameNumber says. */
function levelsOf(number, { bits } = CODE) {
  const text = number.toString(2).padStart(bits, "0");
  const isEven = [...text].filter((one) => one === "1").length % 2 === 0;
  return [...text, isEven ? "1" : "0"].map((one) => 255 * Number(one));
}

test("each frame is that of its picture when times are rounded to milliseconds", () => {
  for (const fps of [12, 23.976, 24, 25, 29.97, 30, 50, 59.94, 60, 120]) {
    for (const rounded of [Math.round, Math.floor, Math.ceil]) {
      for (let frame = 0; frame < 2000; frame++) {
        assert.equal(placeOf(rounded((1000 * frame) / fps) / 1000, fps), frame);
      }
    }
  }
});

test("a picture between two frames is between them", () => {
  assert.equal(placeOf(0.5 / 30, 30), 0.5);
  assert.equal(placeOf(7.25 / 24, 24), 7.25);
});

test("a picture before the first frame is of the first", () => {
  assert.equal(placeOf(-0.3, 30), 0);
});

test("a video is sought inside of the picture of its frame", () => {
  for (const fps of [24, 29.97, 30]) {
    for (let frame = 0; frame < 500; frame++) {
      for (const videoFps of [fps, 2 * fps]) {
        const shown = Math.floor(timeOf(frame, fps) * videoFps);
        assert.equal(Math.floor(shown * (fps / videoFps)), frame);
      }
    }
  }
});

test("a video is sought between two frames where the place is", () => {
  assert.equal(timeOf(3.5, 10), 0.35);
  assert.equal(timeOf(3.999, 10), 0.375);
});

test("nothing is said when a video is longer or shorter by a frame at most", () => {
  assert.deepEqual(commonOf(90, 30, 3.03), { nFrames: 90, warning: null });
  assert.deepEqual(commonOf(90, 30, 2.967), { nFrames: 89, warning: null });
});

test("what both have is played when one is longer", () => {
  const longer = commonOf(90, 30, 4);
  assert.equal(longer.nFrames, 90);
  assert.match(longer.warning, /3\.00 s.*4\.00 s.*3\.00 s are played.*end of the video/);
  const shorter = commonOf(90, 30, 2);
  assert.equal(shorter.nFrames, 60);
  assert.match(shorter.warning, /2\.00 s are played.*end of the mesh/);
});

test("the mesh is played when it is not known how long a video is", () => {
  assert.deepEqual(commonOf(90, 30, Infinity), { nFrames: 90, warning: null });
  assert.deepEqual(commonOf(90, 30, NaN), { nFrames: 90, warning: null });
});

test("one frame is played when a video ends before it begins", () => {
  assert.equal(commonOf(90, 30, -1).nFrames, 1);
});

test("every number is read as it was written", () => {
  for (let number = 0; number < 2 ** CODE.bits; number++) {
    assert.equal(numberIn(cellsOf(levelsOf(number)), CODE), number);
  }
});

test("numbers are read when black and white are those of television", () => {
  const levels = levelsOf(19).map((level) => 16 + (level * 219) / 255);
  assert.equal(numberIn(cellsOf(levels), CODE), 19);
});

test("no number is read when any one cell is wrong", () => {
  for (let number = 0; number < 2 ** CODE.bits; number++) {
    for (let cell = 0; cell <= CODE.bits; cell++) {
      const levels = levelsOf(number);
      levels[cell] = 255 - levels[cell];
      assert.equal(numberIn(cellsOf(levels), CODE), null);
    }
  }
});

test("no number is read when a cell is grey", () => {
  const levels = levelsOf(5);
  levels[2] = 128;
  assert.equal(numberIn(cellsOf(levels), CODE), null);
});

test("no number is read in a black picture", () => {
  assert.equal(numberIn(cellsOf(Array(6).fill(0)), CODE), null);
});

test("edges of cells do not count when they are blurred", () => {
  const levels = levelsOf(22);
  const pixels = cellsOf(levels);
  const { width, height } = sizeOf(CODE);
  for (let i = 0; i < width * height; i++) {
    const [x, y] = [(i % width) % CODE.cell, Math.floor(i / width)];
    if (Math.min(x, y, CODE.cell - 1 - x, CODE.cell - 1 - y) < 2) pixels.fill(128, 4 * i, 4 * i + 3);
  }
  assert.equal(numberIn(pixels, CODE), 22);
});

test("cells that cannot be are refused in words", () => {
  const wrong = [{ x: -1 }, { y: 0.5 }, { cell: 3 }, { bits: 0 }, { bits: 31 }, { cell: NaN }];
  for (const one of wrong) {
    assert.throws(() => checkFrameNumber({ ...CODE, ...one }), {
      name: "InvalidInputError",
      message: /frameNumber must have x and y from 0 on, cell from 4 on and bits from 1 to 30/,
    });
  }
  checkFrameNumber(CODE);
});
