import assert from "node:assert/strict";
import { test } from "node:test";

import { loadModule, settled } from "./three_modules.mjs";

const { Playback } = await loadModule("playback");

const FRAMES = 4;

/** Playback of blocks of four frames at 10 fps; blocks load when the test calls `deliver`. */
class Fixture {
  constructor(nBlocks = 3) {
    this.events = [];
    this.moments = [];
    this.held = new Set();
    this.maxHeld = 0;
    this.requests = [];
    const nFrames = FRAMES;
    const blocks = Array.from({ length: nBlocks }, (_, i) => ({ start: nFrames * i, nFrames }));
    const display = {
      load: async (_segment, number, signal) => {
        const block = await this.request(number, signal);
        this.held.add(block.index);
        this.maxHeld = Math.max(this.maxHeld, this.held.size);
        return block;
      },
      release: (_segment, block) => this.held.delete(block.index),
      show: (_segment, { block, t, next, nextT, fraction }) => {
        this.moments.push([block.index, t, next.index, nextT, fraction]);
      },
    };
    const segments = [{ start: 0, nFrames: nFrames * nBlocks }];
    const file = { info: { name: "", fps: 10 }, segments, first: { info: { blocks } } };
    this.player = new Playback(file, display, (event) => {
      if (event.type !== "progress") this.events.push(event);
    });
  }

  request(number, signal) {
    return new Promise((resolve, reject) => {
      signal.addEventListener("abort", () => reject(signal.reason));
      this.requests.push({ number, signal, resolve, reject });
    });
  }

  get types() {
    return this.events.map((event) => event.type);
  }

  /** Deliver requested blocks, or errors, until there are no requests. */
  async deliver(errors = {}) {
    for (;;) {
      const open = this.requests.filter((one) => !one.isDone && !one.signal.aborted);
      if (!open.length) return;
      for (const one of open) {
        one.isDone = true;
        const { number } = one;
        if (errors[number]) one.reject(errors[number]);
        else one.resolve({ index: number, start: FRAMES * number, nFrames: FRAMES });
      }
      await settled();
    }
  }
}

async function started(nBlocks) {
  const fixture = new Fixture(nBlocks);
  fixture.player.restart();
  await fixture.deliver();
  fixture.events.length = 0;
  fixture.moments.length = 0;
  return fixture;
}

function damaged() {
  return Object.assign(new Error("block 1 is damaged"), { name: "CorruptStreamError" });
}

test("nothing is loaded before the display is ready", async () => {
  const fixture = new Fixture();
  fixture.player.play();
  fixture.player.update(1);
  assert.deepEqual([fixture.requests, fixture.events, fixture.player.clock.time], [[], [], 0]);
});

test("the first frame is shown once loaded, and the next block is requested", async () => {
  const fixture = new Fixture();
  fixture.player.restart();
  assert.deepEqual(fixture.requests.map((one) => one.number), [0]);
  await fixture.deliver();
  assert.deepEqual(fixture.requests.map((one) => one.number), [0, 1]);
  assert.deepEqual(fixture.moments, [[0, 0, 0, 0, 0]]);
  assert.deepEqual(fixture.events, [{ type: "frame", frame: 0, time: 0 }]);
});

test("a file without frames is rejected", () => {
  assert.throws(() => new Fixture(0), { name: "InvalidInputError", message: /no frames/ });
});

test("the same picture is not shown twice", async () => {
  const { player, moments } = await started();
  player.update(0.1);
  player.show();
  assert.deepEqual(moments, []);
});

test("a picture between two blocks uses both", async () => {
  const { player, moments } = await started();
  player.seek(3.25);
  assert.deepEqual(moments, [[0, 3, 1, 0, 0.25]]);
});

test("at most two blocks are in memory during playback in both directions", async () => {
  for (const [loop, speed] of [[true, 1], [true, -1], ["pingpong", 1.5], [false, 1]]) {
    const fixture = await started(5);
    fixture.player.clock.loop = loop;
    fixture.player.clock.speed = speed;
    fixture.player.play();
    for (let i = 0; i < 200; i++) {
      fixture.player.update(0.03);
      await fixture.deliver();
    }
    assert.equal(fixture.maxHeld, 2);
    assert.ok(new Set(fixture.moments.map(([block]) => block)).size === 5, loop);
    assert.ok(!fixture.types.includes("error"));
  }
});

test("playback never waits if blocks load in time", async () => {
  const fixture = await started(5);
  fixture.player.play();
  for (let i = 0; i < 100; i++) {
    fixture.player.update(0.03);
    await fixture.deliver();
  }
  assert.ok(!fixture.types.includes("waiting"));
  assert.equal(fixture.types.filter((type) => type === "loop").length, 1);
});

test("the time does not advance while a block is missing", async () => {
  const fixture = await started();
  fixture.player.play();
  fixture.player.update(0.35);
  fixture.player.update(0.1); // block 2 is requested but not delivered
  fixture.player.update(0.4);
  const { time } = fixture.player.clock;
  const shown = fixture.moments.length;
  fixture.player.update(0.3);
  assert.deepEqual([fixture.player.clock.time, fixture.moments.length], [time, shown]);
  assert.deepEqual(fixture.events.at(-1), { type: "waiting", block: 2 });
  assert.ok(fixture.player.isWaiting);
  await fixture.deliver();
  assert.deepEqual(fixture.types.slice(-2), ["playing", "frame"]);
});

test("the event playing is sent once the picture is available", async () => {
  const fixture = await started();
  fixture.player.play();
  assert.deepEqual(fixture.types, ["playing"]);
  fixture.player.pause();
  fixture.player.seek(9);
  fixture.player.play();
  assert.deepEqual(fixture.types, ["playing", "waiting"]);
  await fixture.deliver();
  assert.deepEqual(fixture.types, ["playing", "waiting", "playing", "frame"]);
});

test("loading of blocks that are no longer needed is aborted", async () => {
  const fixture = await started(6);
  fixture.player.seek(17);
  fixture.player.seek(9);
  assert.deepEqual(
    fixture.requests.slice(2).map((one) => [one.number, one.signal.aborted]),
    [[4, true], [2, false]],
  );
  await fixture.deliver();
  assert.deepEqual([...fixture.held].sort(), [2, 3]);
  assert.ok(!fixture.types.includes("error"));
});

test("a damaged block is reported once and skipped", async () => {
  const fixture = new Fixture(3);
  fixture.player.restart();
  await fixture.deliver({ 1: damaged() });
  fixture.player.play();
  for (let i = 0; i < 60; i++) {
    fixture.player.update(0.05);
    await fixture.deliver();
  }
  const errors = fixture.events.filter((event) => event.type === "error");
  const reported = errors.map(({ block, error }) => [block, error.name]);
  assert.deepEqual(reported, [[1, "CorruptStreamError"]]);
  assert.deepEqual([...new Set(fixture.moments.flatMap(([a, , b]) => [a, b]))], [0, 2]);
  assert.equal(fixture.requests.filter((one) => one.number === 1).length, 1);
  assert.ok(!fixture.types.includes("waiting"));
  assert.equal(fixture.types.filter((type) => type === "loop").length, 2);
});

test("a block that failed to load is requested again by play", async () => {
  const fixture = new Fixture(1);
  fixture.player.restart();
  await fixture.deliver({ 0: new Error("no connection") });
  fixture.player.update(0.1);
  assert.deepEqual([fixture.types, fixture.requests.length], [["error"], 1]);
  fixture.player.play();
  assert.equal(fixture.requests.length, 2);
  await fixture.deliver();
  assert.deepEqual(fixture.types, ["error", "playing", "frame"]);
});

test("playing once sends ended, and playing again restarts", async () => {
  const fixture = await started(1);
  fixture.player.clock.loop = false;
  fixture.player.play();
  fixture.player.update(1);
  assert.deepEqual(fixture.types, ["playing", "frame", "ended"]);
  assert.equal(fixture.player.isPlaying, false);
  fixture.player.play();
  assert.equal(fixture.player.clock.time, 0);
});

test("invalid times are rejected", async () => {
  const { player } = await started();
  for (const seconds of [-0.1, NaN, Infinity]) {
    assert.throws(() => player.update(seconds), { name: "InvalidInputError" });
  }
  assert.throws(() => player.seek(NaN), { name: "InvalidInputError" });
});

test("dispose releases all blocks and stops loading", async () => {
  const fixture = await started(6);
  fixture.player.seek(17);
  fixture.player.dispose();
  assert.ok(fixture.requests.at(-1).signal.aborted);
  const count = fixture.requests.length;
  fixture.player.update(0.1);
  fixture.player.seek(3);
  await settled();
  assert.deepEqual([fixture.held.size, fixture.requests.length], [0, count]);
});

test("a block that loads after its request was aborted is released", async () => {
  const fixture = new Fixture(6);
  const { player, held } = fixture;
  player.restart();
  const [first] = fixture.requests;
  first.resolve({ index: 0, start: 0, nFrames: FRAMES });
  player.dispose();
  await settled();
  assert.deepEqual([held.size, fixture.events], [0, []]);
});

test("blocks are loaded again when the display has lost its data", async () => {
  const fixture = await started();
  fixture.player.seek(2);
  fixture.player.restart();
  await fixture.deliver();
  assert.deepEqual(fixture.moments, [[0, 2, 0, 2, 0], [0, 2, 0, 2, 0]]);
});

test("loaded frames are reported", async () => {
  const fixture = await started(6);
  fixture.player.seek(9);
  await fixture.deliver();
  assert.deepEqual(fixture.player.loaded, [{ start: 8, nFrames: 8 }]);
});
