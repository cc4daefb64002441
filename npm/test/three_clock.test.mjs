import assert from "node:assert/strict";
import { test } from "node:test";

import { loadModule } from "./three_modules.mjs";

const { Clock } = await loadModule("clock");

function clock(options = {}, nFrames = 10, fps = 10) {
  return Object.assign(new Clock(nFrames, fps), options);
}

function near(actual, expected) {
  assert.ok(Math.abs(actual - expected) < 1e-9, `${actual} is not ${expected}`);
}

test("time advances at the playback speed", () => {
  const it = clock({ speed: 2 });
  assert.equal(it.advance(0.1), null);
  near(it.time, 0.2);
  assert.equal(it.current(true).frame, 2);
});

test("positions are interpolated only on request", () => {
  const it = clock();
  it.advance(0.125);
  assert.deepEqual(it.current(true), { frame: 1, fraction: 0.25 });
  assert.deepEqual(it.current(false), { frame: 1, fraction: 0 });
});

test("the last frame is not interpolated with the first", () => {
  const it = clock();
  it.advance(0.95);
  assert.deepEqual(it.current(true), { frame: 9, fraction: 0 });
  assert.equal(it.advance(0.1), "loop");
  near(it.time, 0.05);
});

test("advancing by several loops keeps the remainder", () => {
  const it = clock();
  assert.equal(it.advance(12.34), "loop");
  near(it.time, 0.34);
});

test("backward playback continues from the first frame to the last", () => {
  const it = clock({ speed: -1 });
  assert.equal(it.advance(0.05), "loop");
  assert.deepEqual(it.current(true), { frame: 9, fraction: 0 });
  assert.equal(it.advance(0.1), null);
  near(it.time, 0.85);
});

test("playing once ends after the last frame", () => {
  const it = clock({ loop: false });
  assert.equal(it.advance(0.95), null);
  assert.equal(it.advance(1), "ended");
  assert.equal(it.time, it.duration);
  assert.deepEqual(it.current(true), { frame: 9, fraction: 0 });
  it.rewind();
  assert.equal(it.time, 0);
});

test("playing once backwards ends at the first frame", () => {
  const it = clock({ loop: false, speed: -1 });
  it.rewind();
  assert.equal(it.time, it.duration);
  assert.equal(it.advance(5), "ended");
  assert.equal(it.time, 0);
});

test("pingpong reverses at the last and the first frame", () => {
  const it = clock({ loop: "pingpong" });
  assert.equal(it.advance(1), "loop");
  near(it.time, 0.8);
  assert.equal(it.isForward, false);
  assert.equal(it.advance(0.9), "loop");
  near(it.time, 0.1);
  assert.equal(it.isForward, true);
  assert.equal(it.advance(1.8), "loop");
  near(it.time, 0.1);
  assert.equal(it.isForward, true);
});

test("positions stay within the animation for random times", () => {
  let seed = 1;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  for (const loop of [true, "pingpong", false]) {
    for (const nFrames of [1, 2, 7]) {
      const it = clock({ loop }, nFrames, 30);
      for (let i = 0; i < 2000; i++) {
        it.speed = 4 * random() - 2;
        it.advance(random() < 0.1 ? 100 * random() : random() / 30);
        const { frame, fraction } = it.current(true);
        assert.ok(frame >= 0 && frame < nFrames && fraction >= 0 && fraction < 1);
        assert.ok(fraction === 0 || frame < nFrames - 1);
        assert.ok(it.time >= 0 && it.time <= it.duration);
      }
    }
  }
});

test("a single frame can be played", () => {
  for (const loop of [true, "pingpong", false]) {
    const it = clock({ loop }, 1);
    it.advance(0.35);
    assert.equal(it.current(true).frame, 0);
  }
});

test("leaving pingpong in reverse resumes forward playback", () => {
  for (const loop of [false, true]) {
    const it = clock({ loop: "pingpong" });
    it.advance(1);
    assert.equal(it.isForward, false);
    it.loop = loop;
    assert.equal(it.isForward, true);
    const before = it.time;
    it.advance(0.05);
    near(it.time, before + 0.05);
  }
});

const TIMES = [5, 5.1, 5.3, 6];

function uneven(options = {}) {
  return Object.assign(new Clock(4, 3, TIMES), options);
}

test("frames are shown when they are due", () => {
  for (const speed of [1, 2]) {
    const it = uneven({ speed });
    const shown = [];
    for (let i = 0; i < 44; i++) {
      shown.push([it.time, it.current(false).frame]);
      it.advance(0.03 / speed);
    }
    for (const [time, frame] of shown) {
      const due = TIMES.findLastIndex((one) => one - 5 <= time);
      assert.equal(frame, due, `at ${time} s`);
    }
  }
});

test("times of uneven frames are found", () => {
  const it = uneven();
  near(it.duration, 1 + 1 / 3);
  for (const [frame, time] of TIMES.entries()) near(it.positionAt(time - 5), frame);
  near(it.positionAt(0.65), 2.5);
  it.seek(2.5);
  near(it.time, 0.65);
});

test("uneven frames loop, also backward and forward", () => {
  const it = uneven();
  assert.equal(it.advance(1.35), "loop");
  near(it.time, 1.35 - 4 / 3);
  const backward = uneven({ speed: -1, loop: false });
  backward.goToEnd();
  assert.equal(backward.advance(1), null);
  near(backward.time, 1 / 3);
  assert.equal(backward.advance(1), "ended");
  const bouncing = uneven({ loop: "pingpong" });
  assert.equal(bouncing.advance(1.2), "loop");
  near(bouncing.time, 0.8);
});
