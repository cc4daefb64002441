import assert from "node:assert/strict";
import { test } from "node:test";

import { loadModule } from "./three_modules.mjs";

const { commonLength, frameAtTime, seekTime } = await loadModule("texture/frame_times");

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
