// The published package: its size, and decoding.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";
import { PACKAGE } from "./support/bundle.mjs";
import { groupsOf } from "./support/container.mjs";
import { PLAYED, streamBytes, expectedOf, sha } from "./support/streams.mjs";

/** Limit of the gzipped decoder of bytes. */
const MAX_BYTES = 74_000;

/** Limit of the gzipped script that reads addresses and responses. */
const MAX_REMOTE_BYTES = 3_800;

/**
 * Limit of the gzipped part for three.js: what a page loads with one segment without UVs, colors and
 * hard edges, drawn by `WebGLRenderer`. That is three.js and no other script, as
 * tests/browser/test_web_examples.py checks.
 */
const MAX_THREE_BYTES = 9_800;

/** The same for a file with images: also the scripts of vertex attributes and of images. */
const MAX_THREE_WITH_IMAGES_BYTES = 12_400;

/** Limit of the gzipped script with <reel-player>. */
const MAX_PLAYER_BYTES = 129_000;

/** Limit of the gzipped page until the first picture of a file without UVs, colors and hard edges. */
const MAX_PAGE_BYTES = 92_000;

void Response; // Node compiles a module of its own when it is first used

const DIST = join(PACKAGE, "dist");
const PAGE = join(PACKAGE, "../src/meshreel/app/viewer/page");

/** A script of a folder, and all its static imports. */
function scripts(name, folder = DIST, loadedScripts = new Map()) {
  if (loadedScripts.has(name)) return loadedScripts;
  const text = readFileSync(join(folder, name), "utf8");
  loadedScripts.set(name, text);
  for (const [, , other] of text.matchAll(/(from|import)"\.\/([^"]+)"/g)) scripts(other, folder, loadedScripts);
  return loadedScripts;
}

function gzippedBytes(texts) {
  return [...texts].reduce((sum, text) => sum + gzipSync(text, { level: 9 }).length, 0);
}

/** Import a separate instance of the package. */
function freshPackage() {
  return import(`${pathToFileURL(join(DIST, "index.js"))}?${Math.random()}`);
}

async function framesHash({ ReelFile }, name = "geometry") {
  const reel = await ReelFile.open(streamBytes(name));
  const frames = [];
  for (let index = 0; index < reel.info.nFrames; index++) frames.push(await reel.frame(index));
  await reel.fields(0);
  reel.close();
  return sha(...frames);
}

test("the decoder is small enough for a page", () => {
  const loadedScripts = scripts("index.js");
  const sizeBytes = gzippedBytes(loadedScripts.values());
  assert.ok(sizeBytes <= MAX_BYTES, `${sizeBytes} bytes`);
  assert.ok(!loadedScripts.has("remote.js"), "the reader of addresses is loaded eagerly");
  const remote = gzippedBytes([readFileSync(join(DIST, "remote.js"))]);
  assert.ok(remote <= MAX_REMOTE_BYTES, `${remote} bytes`);
  const threeScripts = scripts("three.js");
  for (const name of loadedScripts.keys()) threeScripts.delete(name);
  const three = gzippedBytes(threeScripts.values());
  assert.ok(three <= MAX_THREE_BYTES, `${three} bytes`);
  const ofImages = ["three_split_drawing.js", "three_material_images.js"];
  const withImages = three + gzippedBytes(ofImages.map((name) => readFileSync(join(DIST, name))));
  assert.ok(withImages <= MAX_THREE_WITH_IMAGES_BYTES, `${withImages} bytes`);
});

test("the player and the page are small until the first picture", () => {
  const player = gzippedBytes(scripts("player.js").values());
  assert.ok(player <= MAX_PLAYER_BYTES, `${player} bytes`);
  const names = readdirSync(PAGE).filter((name) => /^(index\.html|remote-\w+\.js)$/.test(name));
  assert.equal(names.length, 2);
  const others = names.map((name) => readFileSync(join(PAGE, name), "utf8"));
  const page = gzippedBytes([...scripts("player.js", PAGE).values(), ...others]);
  assert.ok(page <= MAX_PAGE_BYTES, `${page} bytes`);
});

test("the package decodes every stream with the built module", async (context) => {
  const { compile } = WebAssembly;
  const compiled = [];
  context.mock.method(WebAssembly, "compile", (bytes) => {
    compiled.push(sha(new Uint8Array(bytes)));
    return compile(bytes);
  });
  const loaded = await freshPackage();
  for (const name of PLAYED) {
    assert.equal(await framesHash(loaded, name), expectedOf(name)["hash of positions"], name);
  }
  assert.deepEqual(compiled, [sha(readFileSync(join(PACKAGE, "wasm/reel.wasm")))]);
});

test("an error names the missing feature when the engine lacks SIMD or DecompressionStream", async (context) => {
  const open = async () => framesHash(await freshPackage());
  const { DecompressionStream } = globalThis;
  globalThis.DecompressionStream = undefined;
  try {
    await assert.rejects(open, { name: "MeshReelError", message: /lacks DecompressionStream; decoding needs/ });
  } finally {
    globalThis.DecompressionStream = DecompressionStream;
  }
  context.mock.method(WebAssembly, "compile", () => Promise.reject(new WebAssembly.CompileError("invalid opcode")));
  await assert.rejects(open, { name: "CompileError", message: /Content-Security-Policy.*invalid opcode/ });
  context.mock.method(WebAssembly, "validate", () => false);
  await assert.rejects(open, { name: "MeshReelError", message: /lacks WebAssembly SIMD; decoding needs/ });
});

test("damage is reported, and other blocks play", async () => {
  const { ReelFile } = await freshPackage();
  const bytes = streamBytes("blocks");
  const [[start, end]] = groupsOf(bytes).at(-1);
  bytes.fill(0xff, start + 9, end);
  const reel = await ReelFile.open(bytes);
  try {
    const [first] = await Promise.allSettled([reel.frame(0), reel.frame(reel.info.nFrames - 1)]);
    await assert.rejects(reel.frame(reel.info.nFrames - 1), { name: "CorruptStreamError" });
    assert.deepEqual(await reel.frame(0), first.value);
  } finally {
    reel.close();
  }
});

test("the first request does not wait for the script that reads addresses", async (context) => {
  const { ReelFile } = await freshPackage();
  const ranges = [];
  context.mock.method(globalThis, "fetch", async (_, { headers }) => {
    ranges.push(headers.get("range"));
    return new Response(streamBytes("geometry"));
  });
  const opening = ReelFile.open("http://localhost/geometry.reel");
  assert.deepEqual(ranges, ["bytes=0-65535"]);
  const reel = await opening;
  reel.close();
  assert.equal(ranges.length, 1);
});

test("the module is compiled once for all files", async (context) => {
  const loaded = await freshPackage();
  const compiled = context.mock.method(WebAssembly, "compile");
  await Promise.all([framesHash(loaded), framesHash(loaded)]);
  assert.equal(compiled.mock.callCount(), 1);
});
