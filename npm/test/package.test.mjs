// The published package: its size, and decoding.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";
import { PACKAGE } from "./support/bundle.mjs";
import { groupsOf } from "./support/container.mjs";
import { PLAYED, streamBytes, expectedOf, sha } from "./support/streams.mjs";

/** Limits of scripts after gzip, which differ between processors: what `import "meshreel"`, and "meshreel/three", loads. */
const [MAX_DECODER_BYTES, MAX_THREE_BYTES] = [91_000, 13_800];

/** Limits of the script with <reel-player>, and of the page of `meshreel view`. */
const [MAX_PLAYER_BYTES, MAX_PAGE_BYTES] = [137_000, 155_000];

void Response; // Node compiles a module of its own when it is first used

const DIST = join(PACKAGE, "dist");
const PAGE = join(PACKAGE, "../src/meshreel/app/viewer/page");

/** A script of a folder, and all its static imports. */
function scripts(name, folder = DIST, loadedScripts = new Map()) {
  if (loadedScripts.has(name)) return loadedScripts;
  const text = readFileSync(join(folder, name), "utf8");
  loadedScripts.set(name, text);
  for (const [, , other] of text.matchAll(/(from|import) ?"\.\/([^"]+)"/g)) scripts(other, folder, loadedScripts);
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

test("scripts are small enough for a page", () => {
  const decoder = scripts("index.js");
  const three = scripts("three.js");
  for (const name of decoder.keys()) three.delete(name);
  const page = [...scripts("player.js", PAGE).values(), readFileSync(join(PAGE, "index.html"), "utf8")];
  for (const [name, texts, maxBytes] of [
    ["decoder", decoder.values(), MAX_DECODER_BYTES],
    ["three.js part", three.values(), MAX_THREE_BYTES],
    ["player", scripts("player.js").values(), MAX_PLAYER_BYTES],
    ["page", page, MAX_PAGE_BYTES],
  ]) {
    const sizeBytes = gzippedBytes(texts);
    assert.ok(sizeBytes <= maxBytes, `${name}: ${sizeBytes} bytes`);
  }
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

test("Node prints short lines and names of classes when an error is not caught", async () => {
  for (const [name, value] of Object.entries(await freshPackage())) assert.equal(value.name, name);
  const url = pathToFileURL(join(DIST, "index.js"));
  const script = `const { ReelFile } = await import("${url}"); await ReelFile.open(new Uint8Array(99))`;
  const { status, stderr } = spawnSync(process.execPath, ["--input-type=module", "-e", script], { encoding: "utf8" });
  assert.equal(status, 1);
  assert.match(stderr, /^CorruptStreamError: not a \.reel stream/m);
  const lines = stderr.split("\n");
  assert.ok(lines.every(({ length }) => length < 300), stderr.slice(0, 1000));
});

test("source maps lead to the sources", () => {
  for (const name of ["index.js", "three.js", "player.js"]) {
    const text = readFileSync(join(DIST, name), "utf8");
    const [, map] = /\/\/# sourceMappingURL=(.+\.map)$/.exec(text);
    const { sources, sourcesContent } = JSON.parse(readFileSync(join(DIST, map), "utf8"));
    assert.ok(sources.length > 5);
    // The player contains shorter shaders and style sheets, which are texts of several lines.
    const comparable = (text) => (name === "player.js" ? text.replace(/`\n[^`]*`/g, "``") : text);
    sources.forEach((source, i) => {
      if (!source.endsWith(".ts")) return; // an import without a file
      const file = readFileSync(join(DIST, source), "utf8");
      assert.equal(comparable(sourcesContent[i]), comparable(file), source);
    });
    const own = name === "three.js" ? "../src/three/reel_mesh.ts" : "../src/engine/engine.ts";
    assert.ok(sources.includes(own), `${name}: ${sources}`);
  }
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

test("the module is compiled once for all files", async (context) => {
  const loaded = await freshPackage();
  const compiled = context.mock.method(WebAssembly, "compile");
  await Promise.all([framesHash(loaded), framesHash(loaded)]);
  assert.equal(compiled.mock.callCount(), 1);
});
