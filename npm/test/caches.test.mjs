// Caches keep what was used last, up to their limits.

import assert from "node:assert/strict";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

import { loadInternals, openSegments } from "./support/bundle.mjs";
import { expectedSegments, segmentedBytes } from "./support/streams.mjs";

/** Limits of open segments, and of WebGL contexts, in the source. */
const [MAX_OPEN_SEGMENTS, MAX_CONTEXTS] = [4, 14];

const { outputFiles } = await build({
  stdin: {
    contents: 'export * from "./page/cache"; export * from "./player/context_pool";',
    resolveDir: fileURLToPath(new URL("../src", import.meta.url)),
  },
  bundle: true,
  format: "esm",
  write: false,
});
const script = Buffer.from(outputFiles[0].contents).toString("base64");
const { Cache, acquireContext, releaseContext } = await import(`data:text/javascript;base64,${script}`);

const internals = await loadInternals();
const { signal } = new AbortController();

/** A cache of squares, and the indices that it has loaded, in order. */
function squares(capacity) {
  const loads = [];
  const fetch = async (index) => {
    loads.push(index);
    return index * index;
  };
  return { cache: new Cache(fetch, capacity), loads };
}

test("a cache evicts the value that was used least recently", async () => {
  const { cache, loads } = squares(3);
  for (const index of [1, 2, 3]) assert.equal(await cache.load(index), index * index);
  assert.equal(await cache.load(1), 1); // used by load
  assert.equal(cache.peek(2), 4); // used by peek
  await cache.load(4);
  assert.deepEqual([1, 2, 3, 4].map((index) => cache.hasOrLoads(index)), [true, true, false, true]);
  await cache.load(5);
  assert.deepEqual([1, 2, 4, 5].map((index) => cache.peek(index)), [undefined, 4, 16, 25]);
  assert.deepEqual(loads, [1, 2, 3, 4, 5]);
});

test("a cache never holds more values than its capacity", async () => {
  const { cache } = squares(2);
  await Promise.all([1, 2, 3, 4, 5].map((index) => cache.load(index)));
  assert.deepEqual([1, 2, 3, 4, 5].filter((index) => cache.hasOrLoads(index)), [4, 5]);
});

test("a cache loads concurrent requests once, and failed ones again", async () => {
  let nLoads = 0;
  const cache = new Cache(async () => {
    if (++nLoads === 1) throw new Error("no network");
    return nLoads;
  }, 2);
  const results = await Promise.allSettled([cache.load(7), cache.load(7)]);
  assert.deepEqual(results.map(({ status }) => status), ["rejected", "rejected"]);
  assert.equal(nLoads, 1);
  assert.deepEqual([cache.nLoading, cache.hasOrLoads(7)], [0, false]);
  assert.equal(await cache.load(7), 2);
});

test("the segments used last stay open, and others are closed", async () => {
  assert.ok(expectedSegments("returning").length > MAX_OPEN_SEGMENTS + 1);
  const { file, engine } = await openSegments(internals, segmentedBytes("returning"), { segment: 0 });
  const engines = [engine];
  for (const number of [1, 2, 3]) engines.push(await file.segment(number, signal));
  assert.equal(await file.segment(0, signal), engines[0]); // used again
  engines.push(await file.segment(4, signal)); // evicts segment 1
  for (const number of [0, 2, 3, 4]) assert.equal(await file.segment(number, signal), engines[number], number);
  await assert.rejects(engines[1].frame(0, 0, signal), { name: "AbortError" });
  await file.segment(5, signal); // evicts segment 0, now the one used least recently
  await assert.rejects(engines[0].frame(0, 0, signal), { name: "AbortError" });
  for (const number of [2, 3, 4]) assert.equal(await file.segment(number, signal), engines[number], number);
  assert.notEqual(await file.segment(1, signal), engines[1]);
});

test("concurrent calls open a segment once", async () => {
  const { file, engine } = await openSegments(internals, segmentedBytes("returning"), { segment: 0 });
  const [one, other] = await Promise.all([1, 1].map((number) => file.segment(number, signal)));
  assert.equal(one, other);
  assert.equal(one, await file.segment(1, signal));
  await one.frame(0, 0, signal);
  assert.equal(await file.segment(0, signal), engine);
});

test("hidden players lose their contexts in the order in which they were visible", () => {
  const suspended = [];
  const holders = Array.from({ length: MAX_CONTEXTS + 3 }, (_, number) => ({
    isVisible: false,
    suspend: () => suspended.push(number),
  }));
  for (const holder of holders.slice(0, MAX_CONTEXTS)) acquireContext(holder);
  assert.deepEqual(suspended, []);
  acquireContext(holders[0]); // visible again
  holders[1].isVisible = true;
  acquireContext(holders[MAX_CONTEXTS]);
  acquireContext(holders[MAX_CONTEXTS + 1]);
  assert.deepEqual(suspended, [2, 3]);
  releaseContext(holders[4]);
  acquireContext(holders[MAX_CONTEXTS + 2]);
  assert.deepEqual(suspended, [2, 3]);
  for (const holder of holders) releaseContext(holder);
});
