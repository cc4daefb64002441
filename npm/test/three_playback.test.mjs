import assert from "node:assert/strict";
import { test } from "node:test";

import { moduleOf, settled } from "./three_modules.mjs";

const { Playback } = await moduleOf("playback");

const FRAMES = 4;

/** A player of blocks of four frames at 10 a second; blocks come when they are answered. */
class Stand {
  constructor(nBlocks = 3) {
    this.events = [];
    this.moments = [];
    this.held = new Set();
    this.mostHeld = 0;
    this.asked = [];
    const nFrames = FRAMES;
    const blocks = Array.from({ length: nBlocks }, (_, i) => ({ start: nFrames * i, nFrames }));
    const screen = {
      hold: (block) => {
        this.held.add(block.number);
        this.mostHeld = Math.max(this.mostHeld, this.held.size);
        return block;
      },
      release: (block) => this.held.delete(block.number),
      show: ({ block, t, next, nextT, fraction, nMoving }) => {
        this.moments.push([block.number, t, next.number, nextT, fraction]);
        this.nMoving = nMoving;
      },
    };
    const load = (number, signal) =>
      new Promise((resolve, reject) => {
        signal.addEventListener("abort", () => reject(signal.reason));
        this.asked.push({ number, signal, resolve, reject });
      });
    this.player = new Playback({ name: "", fps: 10, blocks }, load, screen, (event) =>
      this.events.push(event),
    );
  }

  get types() {
    return this.events.map((event) => event.type);
  }

  /** Answers what is asked for, until nothing more is. */
  async answer(errors = {}) {
    for (;;) {
      const open = this.asked.filter((one) => !one.isDone && !one.signal.aborted);
      if (!open.length) return;
      for (const one of open) {
        one.isDone = true;
        const { number } = one;
        if (errors[number]) one.reject(errors[number]);
        else one.resolve({ number, start: FRAMES * number, nFrames: FRAMES });
      }
      await settled();
    }
  }
}

async function started(nBlocks) {
  const stand = new Stand(nBlocks);
  stand.player.restart();
  await stand.answer();
  stand.events.length = 0;
  stand.moments.length = 0;
  return stand;
}

function damaged() {
  return Object.assign(new Error("block 1 is damaged"), { name: "CorruptStreamError" });
}

test("nothing is loaded before there is a screen", async () => {
  const stand = new Stand();
  stand.player.play();
  stand.player.update(1);
  assert.deepEqual([stand.asked, stand.events, stand.player.clock.time], [[], [], 0]);
});

test("the first frame is shown when it has come, and the next block asked for", async () => {
  const stand = new Stand();
  stand.player.restart();
  assert.deepEqual(stand.asked.map((one) => one.number), [0]);
  await stand.answer();
  assert.deepEqual(stand.asked.map((one) => one.number), [0, 1]);
  assert.deepEqual(stand.moments, [[0, 0, 0, 0, 0]]);
  assert.deepEqual(stand.events, [{ type: "frame", frame: 0, time: 0 }]);
});

test("a file without frames is refused", () => {
  assert.throws(() => new Stand(0), { name: "InvalidInputError", message: /no frames/ });
});

test("the same picture is not shown twice", async () => {
  const { player, moments } = await started();
  player.update(0.1);
  player.show();
  assert.deepEqual(moments, []);
});

test("a picture between blocks is made of both", async () => {
  const { player, moments } = await started();
  player.seek(3.25);
  assert.deepEqual(moments, [[0, 3, 1, 0, 0.25]]);
});

test("at most two blocks are held when all are played, forwards and backwards", async () => {
  for (const [loop, speed] of [["repeat", 1], ["repeat", -1], ["pingpong", 1.5], ["once", 1]]) {
    const stand = await started(5);
    stand.player.clock.loop = loop;
    stand.player.clock.speed = speed;
    stand.player.play();
    for (let i = 0; i < 200; i++) {
      stand.player.update(0.03);
      await stand.answer();
    }
    assert.equal(stand.mostHeld, 2);
    assert.ok(new Set(stand.moments.map(([block]) => block)).size === 5, loop);
    assert.ok(!stand.types.includes("error"));
  }
});

test("playing never waits when blocks come ahead of it", async () => {
  const stand = await started(5);
  stand.player.play();
  for (let i = 0; i < 100; i++) {
    stand.player.update(0.03);
    await stand.answer();
  }
  assert.ok(!stand.types.includes("waiting"));
  assert.equal(stand.types.filter((type) => type === "loop").length, 1);
});

test("the time stands still as long as a block is missing", async () => {
  const stand = await started();
  stand.player.play();
  stand.player.update(0.35);
  stand.player.update(0.1); // block 2 is asked for, and does not come
  stand.player.update(0.4);
  const { time } = stand.player.clock;
  const shown = stand.moments.length;
  stand.player.update(0.3);
  assert.deepEqual([stand.player.clock.time, stand.moments.length], [time, shown]);
  assert.deepEqual(stand.events.at(-1), { type: "waiting", block: 2 });
  assert.ok(stand.player.isWaiting);
  await stand.answer();
  assert.deepEqual(stand.types.slice(-2), ["playing", "frame"]);
});

test("playing is told once the picture is there", async () => {
  const stand = await started();
  stand.player.play();
  assert.deepEqual(stand.types, ["playing"]);
  stand.player.pause();
  stand.player.seek(9);
  stand.player.play();
  assert.deepEqual(stand.types, ["playing", "waiting"]);
  await stand.answer();
  assert.deepEqual(stand.types, ["playing", "waiting", "playing", "frame"]);
});

test("loading of blocks that are not wanted any more is aborted", async () => {
  const stand = await started(6);
  stand.player.seek(17);
  stand.player.seek(9);
  assert.deepEqual(
    stand.asked.slice(2).map((one) => [one.number, one.signal.aborted]),
    [[4, true], [2, false]],
  );
  await stand.answer();
  assert.deepEqual([...stand.held].sort(), [2, 3]);
  assert.ok(!stand.types.includes("error"));
});

test("a damaged block is passed over, and told once, and the rest plays", async () => {
  const stand = new Stand(3);
  stand.player.restart();
  await stand.answer({ 1: damaged() });
  stand.player.play();
  for (let i = 0; i < 60; i++) {
    stand.player.update(0.05);
    await stand.answer();
  }
  const errors = stand.events.filter((event) => event.type === "error");
  const told = errors.map(({ block, error }) => [block, error.name]);
  assert.deepEqual(told, [[1, "CorruptStreamError"]]);
  assert.deepEqual([...new Set(stand.moments.flatMap(([a, , b]) => [a, b]))], [0, 2]);
  assert.equal(stand.asked.filter((one) => one.number === 1).length, 1);
  assert.ok(!stand.types.includes("waiting"));
  assert.equal(stand.types.filter((type) => type === "loop").length, 2);
});

test("a block that a server did not give is asked for again when it is played", async () => {
  const stand = new Stand(1);
  stand.player.restart();
  await stand.answer({ 0: new Error("no connection") });
  stand.player.update(0.1);
  assert.deepEqual([stand.types, stand.asked.length], [["error"], 1]);
  stand.player.play();
  assert.equal(stand.asked.length, 2);
  await stand.answer();
  assert.deepEqual(stand.types, ["error", "playing", "frame"]);
});

test("the end is told, and playing begins at the start again, when it plays once", async () => {
  const stand = await started(1);
  stand.player.clock.loop = "once";
  stand.player.play();
  stand.player.update(1);
  assert.deepEqual(stand.types, ["playing", "frame", "ended"]);
  assert.equal(stand.player.isPlaying, false);
  stand.player.play();
  assert.equal(stand.player.clock.time, 0);
});

test("numbers that are no times are refused", async () => {
  const { player } = await started();
  for (const seconds of [-0.1, NaN, Infinity]) {
    assert.throws(() => player.update(seconds), { name: "InvalidInputError" });
  }
  assert.throws(() => player.seek(NaN), { name: "InvalidInputError" });
});

test("all is let go, and nothing more asked for, when it is disposed of", async () => {
  const stand = await started(6);
  stand.player.seek(17);
  stand.player.dispose();
  assert.ok(stand.asked.at(-1).signal.aborted);
  const count = stand.asked.length;
  stand.player.update(0.1);
  stand.player.seek(3);
  await settled();
  assert.deepEqual([stand.held.size, stand.asked.length], [0, count]);
});

test("a block that comes after it was aborted is released", async () => {
  const stand = new Stand(6);
  const { player, held } = stand;
  player.restart();
  const [first] = stand.asked;
  first.resolve({ number: 0, start: 0, nFrames: FRAMES });
  player.dispose();
  await settled();
  assert.deepEqual([held.size, stand.events], [0, []]);
});

test("blocks are loaded anew when the screen has lost them", async () => {
  const stand = await started();
  stand.player.seek(2);
  stand.player.restart();
  await stand.answer();
  assert.deepEqual(stand.moments, [[0, 2, 0, 2, 0], [0, 2, 0, 2, 0]]);
});

test("a frame is shown again at once where another number of modes is to move", async () => {
  const stand = await started(2);
  const { player, moments } = stand;
  const shown = moments.length;
  player.nMoving = 3;
  assert.deepEqual([moments.length, stand.nMoving], [shown + 1, 3]);
  player.nMoving = 3;
  assert.equal(moments.length, shown + 1);
});
