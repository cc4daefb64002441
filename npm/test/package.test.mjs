// The published package: its size, and decoding with and without SIMD.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";
import { separateStreams } from "../wasm_streams.mjs";
import { PACKAGE } from "./support/bundle.mjs";
import { groupsOf } from "./support/container.mjs";
import { COMMON, PLAYED, streamBytes, expectedOf, sha } from "./support/streams.mjs";

/** Limit of the gzipped decoder of bytes: the module and all scripts that are loaded with it. */
const MAX_BYTES = 40_000;

/** Limit of the gzipped script that reads addresses and responses. */
const MAX_REMOTE_BYTES = 3_800;

/** Limit of the gzipped whole module and whole engine. */
const MAX_WHOLE_BYTES = 60_700;

/**
 * Limit of the gzipped part for three.js: what a page loads with one segment without UVs, colors and
 * hard edges, drawn by `WebGLRenderer`. That is three.js and no other script, as
 * tests/browser/test_web_examples.py checks.
 */
const MAX_THREE_BYTES = 9_800;

/** The same for a file with images: also the scripts of vertex attributes and of images. */
const MAX_THREE_WITH_IMAGES_BYTES = 12_400;

/** Limit of the gzipped script with <reel-player>. */
const MAX_PLAYER_BYTES = 95_300;

/** Limit of the gzipped page until the first picture of a file without UVs, colors and hard edges. */
const MAX_PAGE_BYTES = 92_000;

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
  assert.ok(!loadedScripts.has("plain_wasm.js"), "the module without SIMD is loaded eagerly");
  assert.ok(!loadedScripts.has("whole_wasm.js"), "the whole module is loaded eagerly");
  assert.ok(!loadedScripts.has("whole_engine.js"), "the whole engine is loaded eagerly");
  assert.ok(!loadedScripts.has("remote.js"), "the reader of addresses is loaded eagerly");
  const remote = gzippedBytes([readFileSync(join(DIST, "remote.js"))]);
  assert.ok(remote <= MAX_REMOTE_BYTES, `${remote} bytes`);
  const whole = gzippedBytes(["whole_wasm.js", "whole_engine.js"].map((name) => readFileSync(join(DIST, name))));
  assert.ok(whole <= MAX_WHOLE_BYTES, `${whole} bytes`);
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

test("the package decodes with SIMD", async () => {
  assert.equal(await framesHash(await freshPackage()), expectedOf("geometry")["hash of positions"]);
});

for (const missing of ["SIMD", "DecompressionStream"]) {
  test(`the package decodes without ${missing}`, async (context) => {
    const { compile } = WebAssembly;
    const sizes = [];
    context.mock.method(WebAssembly, "compile", (bytes) => {
      sizes.push(bytes.byteLength);
      return compile(bytes);
    });
    if (missing === "SIMD") context.mock.method(WebAssembly, "validate", () => false);
    const before = globalThis.DecompressionStream;
    if (missing !== "SIMD") globalThis.DecompressionStream = undefined;
    try {
      const hash = await framesHash(await freshPackage());
      assert.equal(hash, expectedOf("geometry")["hash of positions"]);
      assert.deepEqual(sizes, [readFileSync(join(PACKAGE, "wasm/reel_plain.wasm")).length]);
    } finally {
      globalThis.DecompressionStream = before;
    }
  });
}

test("an exact track is decoded without SIMD", async (context) => {
  context.mock.method(WebAssembly, "validate", () => false);
  const { ReelFile } = await freshPackage();
  const reel = await ReelFile.open(streamBytes("exact_f4"));
  const [{ name }] = reel.info.tracks;
  const frames = [];
  for (let t = 0; t < reel.info.nFrames; t++) frames.push(await reel.track(name).frame(t));
  reel.close();
  assert.equal(sha(...frames), expectedOf("exact_f4").tracks[0]["hash of values"]);
});

test("the compiled modules equal the built ones", async (context) => {
  const { compile } = WebAssembly;
  const compiled = [];
  context.mock.method(WebAssembly, "compile", (bytes) => {
    compiled.push(sha(bytes));
    return compile(bytes);
  });
  const { ReelFile } = await freshPackage();
  const reel = await ReelFile.open(streamBytes("exact_f4"));
  await reel.track(reel.info.tracks[0].name).frame(0);
  reel.close();
  const built = ["reel", "reel_whole"].map((name) => sha(readFileSync(join(PACKAGE, `wasm/${name}.wasm`))));
  assert.deepEqual(compiled, built);
});

test("every stream plays, and few load the whole module", async (context) => {
  const { compile } = WebAssembly;
  const sizes = [];
  context.mock.method(WebAssembly, "compile", (bytes) => {
    sizes.push(bytes.byteLength);
    return compile(bytes);
  });
  const small = readFileSync(join(PACKAGE, "wasm/reel.wasm")).length;
  const whole = readFileSync(join(PACKAGE, "wasm/reel_whole.wasm")).length;
  for (const name of PLAYED) {
    sizes.length = 0;
    const loaded = await freshPackage();
    assert.equal(await framesHash(loaded, name), expectedOf(name)["hash of positions"], name);
    assert.deepEqual(sizes, COMMON.includes(name) ? [small] : [small, whole], name);
  }
});

test("damage that the small module finds is reported, and other blocks play", async () => {
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

test("a module with an unknown opcode is not separated into streams", () => {
  const code = [1, 3, 0, 0xff, 0x0b]; // one function, without locals
  const module = Uint8Array.from([0, 97, 115, 109, 1, 0, 0, 0, 10, code.length, ...code]);
  assert.throws(() => separateStreams(module), /unknown opcode 0xff/);
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
