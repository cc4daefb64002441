// What is published: its size, and that it decodes with vectors and without.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";
import { PACKAGE } from "./support/bundle.mjs";
import { bytesOf, said, sha } from "./support/streams.mjs";

/** Of the decoder after gzip: module, scripts, and how they get bytes from servers. */
const MAX_BYTES = 63_500;

/** Of the module that decodes tracks and exact positions, too. */
const MAX_WHOLE_BYTES = 59_900;

/** Of the part for three.js. */
const MAX_THREE_BYTES = 11_700;

const DIST = join(PACKAGE, "dist");

/** The script of a file in dist/, and of all that it imports before it runs. */
function scripts(name, found = new Map()) {
  if (found.has(name)) return found;
  const text = readFileSync(join(DIST, name), "utf8");
  found.set(name, text);
  for (const [, , other] of text.matchAll(/(from|import)"\.\/([^"]+)"/g)) scripts(other, found);
  return found;
}

/** The package anew, as in a page of its own. */
function freshPackage() {
  return import(`${pathToFileURL(join(DIST, "index.js"))}?${Math.random()}`);
}

async function hashOfFrames({ ReelFile }) {
  const reel = await ReelFile.open(bytesOf("geometry"));
  const frames = [];
  for (let number = 0; number < reel.info.nFrames; number++) frames.push(await reel.frame(number));
  reel.close();
  return sha(...frames);
}

test("the decoder is small enough for a page", () => {
  const found = scripts("index.js");
  const sizes = [...found.values()].map((text) => gzipSync(text, { level: 9 }).length);
  const sizeBytes = sizes.reduce((sum, size) => sum + size, 0);
  assert.ok(sizeBytes <= MAX_BYTES, `${sizeBytes} bytes`);
  assert.ok(!found.has("plain_wasm.js"), "the plain module comes with the other");
  assert.ok(!found.has("whole_wasm.js"), "what decodes tracks comes with the rest");
  const whole = gzipSync(readFileSync(join(DIST, "whole_wasm.js")), { level: 9 }).length;
  assert.ok(whole <= MAX_WHOLE_BYTES, `${whole} bytes`);
  const three = gzipSync(readFileSync(join(DIST, "three.js")), { level: 9 }).length;
  assert.ok(three <= MAX_THREE_BYTES, `${three} bytes`);
});

test("the package decodes with vectors", async () => {
  assert.equal(await hashOfFrames(await freshPackage()), said("geometry")["hash of positions"]);
});

for (const missing of ["vectors", "DecompressionStream"]) {
  test(`the package decodes where there is no ${missing}`, async (context) => {
    const { compile } = WebAssembly;
    const sizes = [];
    context.mock.method(WebAssembly, "compile", (bytes) => {
      sizes.push(bytes.byteLength);
      return compile(bytes);
    });
    if (missing === "vectors") context.mock.method(WebAssembly, "validate", () => false);
    const before = globalThis.DecompressionStream;
    if (missing !== "vectors") globalThis.DecompressionStream = undefined;
    try {
      const found = await hashOfFrames(await freshPackage());
      assert.equal(found, said("geometry")["hash of positions"]);
      assert.deepEqual(sizes, [readFileSync(join(PACKAGE, "wasm/reel_plain.wasm")).length]);
    } finally {
      globalThis.DecompressionStream = before;
    }
  });
}

test("an exact track is decoded where there are no vectors", async (context) => {
  context.mock.method(WebAssembly, "validate", () => false);
  const { ReelFile } = await freshPackage();
  const reel = await ReelFile.open(bytesOf("exact_f4"));
  const [{ name }] = reel.info.tracks;
  const frames = [];
  for (let t = 0; t < reel.info.nFrames; t++) frames.push(await reel.track(name).frame(t));
  reel.close();
  assert.equal(sha(...frames), said("exact_f4").tracks[0]["hash of values"]);
});

test("the module is compiled once for all files", async (context) => {
  const loaded = await freshPackage();
  const compiled = context.mock.method(WebAssembly, "compile");
  await Promise.all([hashOfFrames(loaded), hashOfFrames(loaded)]);
  assert.equal(compiled.mock.callCount(), 1);
});
