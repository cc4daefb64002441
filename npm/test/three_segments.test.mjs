// Playback of files with several segments, whose blocks are known once a segment is open.

import assert from "node:assert/strict";
import { test } from "node:test";

import { loadModule, settled } from "./three_modules.mjs";

const { Playback } = await loadModule("playback");

/** Frames of each block of the segments, in which frames are counted from 0. */
const SEGMENTS = [[4, 4], [3], [2, 2, 2]];

/** Plays three segments at 10 fps; calls wait until the test calls `deliver`. */
class Fixture {
  constructor() {
    this.events = [];
    this.calls = [];
    this.moments = [];
    let start = 0;
    const segments = SEGMENTS.map((blocks) => {
      const nFrames = blocks.reduce((sum, one) => sum + one, 0);
      start += nFrames;
      return { start: start - nFrames, nFrames };
    });
    const wait = (name, result, signal) =>
      new Promise((resolve, reject) => {
        signal.addEventListener("abort", () => reject(signal.reason));
        this.calls.push({ name, resolve: () => resolve(result), reject, signal });
      });
    const file = {
      ...{ info: { name: "", fps: 10 }, segments, first: openSegment(0) },
      segment: (segment, { signal }) => wait(`open ${segment}`, openSegment(segment), signal),
    };
    const display = {
      load: (segment, block, signal) =>
        wait(`load ${segment}.${block}`, { id: `${segment}.${block}`, segment }, signal),
      release: () => {},
      show: (segment, { block, t, next, nextT, fraction }) => {
        assert.deepEqual([block.segment, next.segment], [segment, segment], "interpolates between segments");
        this.moments.push([block.id, t, next.id, nextT, fraction]);
      },
    };
    this.player = new Playback(file, display, (event) => {
      if (event.type !== "progress") this.events.push(event);
    });
  }

  /** Answer all calls, some with errors, until there are none; returns their names. */
  async deliver(errors = {}) {
    const names = [];
    for (;;) {
      const call = this.calls.find((one) => !one.isDone && !one.signal.aborted);
      if (!call) return names;
      call.isDone = true;
      names.push(call.name);
      if (errors[call.name]) call.reject(errors[call.name]);
      else call.resolve();
      await settled();
    }
  }
}

function openSegment(segment) {
  let start = 0;
  const blocks = SEGMENTS[segment].map((nFrames) => ({ start: (start += nFrames) - nFrames, nFrames }));
  return { info: { blocks } };
}

async function started() {
  const fixture = new Fixture();
  fixture.player.restart();
  const names = await fixture.deliver();
  return { fixture, player: fixture.player, names };
}

test("frames are numbered across segments", async () => {
  const { player } = await started();
  assert.equal(player.nFrames, 17);
});

test("the next segment is opened and loaded before it is played", async () => {
  const { fixture, player, names } = await started();
  assert.deepEqual(names, ["load 0.0", "load 0.1"]);
  player.play();
  player.update(0.41);
  assert.deepEqual(await fixture.deliver(), ["open 1", "load 1.0"]);
  player.update(0.4);
  assert.deepEqual(await fixture.deliver(), ["open 2", "load 2.0"]);
  assert.deepEqual(fixture.moments.at(-1).slice(0, 2), ["1.0", 0]);
  assert.ok(fixture.events.every(({ type }) => type !== "waiting"));
});

test("the last frame of a segment is not interpolated with the next segment", async () => {
  const { fixture, player } = await started();
  player.seek(7.5);
  await fixture.deliver();
  assert.deepEqual(fixture.moments.at(-1), ["0.1", 3, "0.1", 3, 0]);
  player.seek(6.5);
  assert.deepEqual(fixture.moments.at(-1), ["0.1", 2, "0.1", 3, 0.5]);
});

test("seeking into a segment that is not open loads only the block of the frame", async () => {
  const { fixture, player } = await started();
  player.seek(16);
  assert.deepEqual(await fixture.deliver(), ["open 2", "load 2.2"]);
  assert.deepEqual(fixture.moments.at(-1).slice(0, 2), ["2.2", 1]);
  assert.deepEqual(fixture.events.filter(({ type }) => type === "waiting").length, 1);
});

test("a segment that is open is not opened again", async () => {
  const { fixture, player } = await started();
  player.seek(16);
  await fixture.deliver();
  player.seek(0);
  await fixture.deliver();
  player.seek(12);
  const names = await fixture.deliver();
  assert.ok(!names.includes("open 2"), String(names));
  assert.deepEqual(fixture.moments.at(-1).slice(0, 2), ["2.0", 1]);
});

test("playing backwards enters a segment at its last block", async () => {
  const { fixture, player } = await started();
  player.change({ speed: -1 });
  player.play();
  player.update(0.01);
  assert.deepEqual(await fixture.deliver(), ["open 2", "load 2.2", "load 2.1"]);
  assert.deepEqual(fixture.moments.at(-1).slice(0, 2), ["2.2", 1]);
});

test("a damaged segment is skipped, and its frames are reported", async () => {
  const error = Object.assign(new Error("damaged"), { name: "CorruptStreamError" });
  const { fixture, player } = await started();
  player.play();
  player.update(0.41);
  await fixture.deliver({ "open 1": error });
  const frames = { start: 8, nFrames: 3 };
  assert.deepEqual(fixture.events.find(({ type }) => type === "error"), {
    ...{ type: "error", error, block: 0, frames },
  });
  for (let i = 0; i < 5; i++) {
    player.update(0.1);
    await fixture.deliver();
  }
  assert.deepEqual(fixture.moments.at(-1).slice(0, 2), ["0.1", 3]);
  player.update(0.2);
  assert.deepEqual(fixture.moments.at(-1).slice(0, 2), ["2.0", 0]);
});
