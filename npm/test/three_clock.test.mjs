import assert from "node:assert/strict";
import { test } from "node:test";

import { moduleOf } from "./three_modules.mjs";

const { Clock } = await moduleOf("clock");

function clock(options = {}, nFrames = 10, fps = 10) {
  return Object.assign(new Clock(nFrames, fps), options);
}

function near(actual, expected) {
  assert.ok(Math.abs(actual - expected) < 1e-9, `${actual} is not ${expected}`);
}

test("time passes at the speed when it is advanced", () => {
  const one = clock({ speed: 2 });
  assert.equal(one.advance(0.1), null);
  near(one.time, 0.2);
  assert.equal(one.at(true).frame, 2);
});

test("a picture lies between two frames only when that is wanted", () => {
  const one = clock();
  one.advance(0.125);
  assert.deepEqual(one.at(true), { frame: 1, fraction: 0.25 });
  assert.deepEqual(one.at(false), { frame: 1, fraction: 0 });
});

test("nothing lies between the last frame and the first when it repeats", () => {
  const one = clock();
  one.advance(0.95);
  assert.deepEqual(one.at(true), { frame: 9, fraction: 0 });
  assert.equal(one.advance(0.1), "loop");
  near(one.time, 0.05);
});

test("it goes on with the rest when many rounds pass at once", () => {
  const one = clock();
  assert.equal(one.advance(12.34), "loop");
  near(one.time, 0.34);
});

test("it goes from the first frame to the last when it repeats backwards", () => {
  const one = clock({ speed: -1 });
  assert.equal(one.advance(0.05), "loop");
  assert.deepEqual(one.at(true), { frame: 9, fraction: 0 });
  assert.equal(one.advance(0.1), null);
  near(one.time, 0.85);
});

test("it ends at the end of the last frame when it plays once", () => {
  const one = clock({ loop: "once" });
  assert.equal(one.advance(0.95), null);
  assert.equal(one.advance(1), "end");
  assert.equal(one.time, one.duration);
  assert.deepEqual(one.at(true), { frame: 9, fraction: 0 });
  one.rewind();
  assert.equal(one.time, 0);
});

test("it ends at the first frame when it plays once and backwards", () => {
  const one = clock({ loop: "once", speed: -1 });
  one.rewind();
  assert.equal(one.time, one.duration);
  assert.equal(one.advance(5), "end");
  assert.equal(one.time, 0);
});

test("it turns at the last frame and at the first when it goes there and back", () => {
  const one = clock({ loop: "pingpong" });
  assert.equal(one.advance(1), "loop");
  near(one.time, 0.8);
  assert.equal(one.isForward, false);
  assert.equal(one.advance(0.9), "loop");
  near(one.time, 0.1);
  assert.equal(one.isForward, true);
  assert.equal(one.advance(1.8), "loop");
  near(one.time, 0.1);
  assert.equal(one.isForward, true);
});

test("it stays inside when times are drawn at random", () => {
  let seed = 1;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  for (const loop of ["repeat", "pingpong", "once"]) {
    for (const nFrames of [1, 2, 7]) {
      const one = clock({ loop }, nFrames, 30);
      for (let i = 0; i < 2000; i++) {
        one.speed = 4 * random() - 2;
        one.advance(random() < 0.1 ? 100 * random() : random() / 30);
        const { frame, fraction } = one.at(true);
        assert.ok(frame >= 0 && frame < nFrames && fraction >= 0 && fraction < 1);
        assert.ok(fraction === 0 || frame < nFrames - 1);
        assert.ok(one.time >= 0 && one.time <= one.duration);
      }
    }
  }
});

test("a single frame stays when it plays", () => {
  for (const loop of ["repeat", "pingpong", "once"]) {
    const one = clock({ loop }, 1);
    one.advance(0.35);
    assert.equal(one.at(true).frame, 0);
  }
});

test("time runs forward again when pingpong is switched off on the way back", () => {
  for (const loop of ["once", "repeat"]) {
    const one = clock({ loop: "pingpong" });
    one.advance(1);
    assert.equal(one.isForward, false);
    one.loop = loop;
    assert.equal(one.isForward, true);
    const before = one.time;
    one.advance(0.05);
    near(one.time, before + 0.05);
  }
});
