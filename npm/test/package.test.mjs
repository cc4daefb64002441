// The published package: its size, and decoding.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";
import { brotliCompressSync, gzipSync } from "node:zlib";
import { PACKAGE } from "./support/bundle.mjs";
import { groupsOf } from "./support/container.mjs";
import { PLAYED, streamBytes, expectedOf, sha } from "./support/streams.mjs";

/**
 * Limits of what a page of meshes loads, after brotli: for `import "meshreel"`, with reel.wasm; in addition for
 * "meshreel/three"; and for <reel-player>, with reel.wasm.
 */
const [MAX_DECODER_BYTES, MAX_THREE_BYTES, MAX_PLAYER_BYTES] = [72_000, 12_600, 120_000];

/** Limit of reel_full.wasm after brotli: what exact values and cells load in addition. */
const MAX_FULL_BYTES = 68_900;

/** Limit of the page of `meshreel view` after gzip, which differs between processors. */
const MAX_PAGE_BYTES = 155_000;

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

/** Import a separate instance of the package. */
function freshPackage(folder = DIST) {
  return import(`${pathToFileURL(join(folder, "index.js"))}?${Math.random()}`);
}

/** Copy the built package without some of its files; returns the folder. */
function packageWithout(context, ...names) {
  const folder = mkdtempSync(join(tmpdir(), "meshreel-"));
  context.after(() => rmSync(folder, { recursive: true }));
  cpSync(DIST, folder, { recursive: true, filter: (path) => !names.some((name) => path.endsWith(name)) });
  return folder;
}

async function framesHash({ ReelFile }, name = "geometry") {
  const reel = await ReelFile.open(streamBytes(name));
  const frames = [];
  for (let index = 0; index < reel.info.nFrames; index++) frames.push(await reel.frame(index));
  await reel.fields(0);
  reel.close();
  return sha(...frames);
}

test("scripts and modules are small enough for a page", () => {
  const decoder = scripts("index.js");
  const three = scripts("three.js");
  for (const name of decoder.keys()) three.delete(name);
  const [meshes, full] = ["reel.wasm", "reel_full.wasm"].map((name) => readFileSync(join(DIST, name)));
  const page = [...scripts("player.js", PAGE).values(), readFileSync(join(PAGE, "index.html"), "utf8")];
  for (const [name, contents, maxBytes, pack] of [
    ["decoder", [meshes, ...decoder.values()], MAX_DECODER_BYTES, brotliCompressSync],
    ["three.js part", three.values(), MAX_THREE_BYTES, brotliCompressSync],
    ["player", [meshes, ...scripts("player.js").values()], MAX_PLAYER_BYTES, brotliCompressSync],
    ["module with exact values and cells", [full], MAX_FULL_BYTES, brotliCompressSync],
    ["page", page, MAX_PAGE_BYTES, (text) => gzipSync(text, { level: 9 })],
  ]) {
    const sizeBytes = [...contents].reduce((sum, content) => sum + pack(content).length, 0);
    assert.ok(sizeBytes <= maxBytes, `${name}: ${sizeBytes} bytes`);
  }
});

/** Mock the compiler; returns the hashes of the modules that it has compiled. */
function compiledModules(context) {
  const { compile } = WebAssembly;
  const compiled = [];
  context.mock.method(WebAssembly, "compile", (bytes) => {
    compiled.push(sha(new Uint8Array(bytes.buffer ?? bytes)));
    return compile(bytes);
  });
  return compiled;
}

const [MESHES, FULL] = ["reel.wasm", "reel_full.wasm"].map((name) => sha(readFileSync(join(PACKAGE, "wasm", name))));

test("the package decodes every stream, and loads the full module only when one needs it", async (context) => {
  const compiled = compiledModules(context);
  const loaded = await freshPackage();
  for (const names of [["geometry", "tracks"], PLAYED]) {
    for (const name of names) {
      assert.equal(await framesHash(loaded, name), expectedOf(name)["hash of positions"], name);
    }
    assert.deepEqual(compiled, names === PLAYED ? [MESHES, FULL] : [MESHES]);
  }
});

test("calls while the full module is being loaded return their values", async () => {
  const { ReelFile } = await freshPackage();
  const [early, late] = await Promise.all([1, 2].map(() => ReelFile.open(streamBytes("values_on_grids"))));
  const names = early.info.tracks.map(({ name }) => name);
  const frames = [3, 1, 2].flatMap((frame) => names.map((name) => [name, frame]));
  const read = (reel) => (name, frame) => reel.track(name).frame(frame);
  const atOnce = await Promise.all([
    ...frames.map(([name, frame]) => read(early)(name, frame)),
    early.frame(2),
  ]);
  for (const [i, [name, frame]] of frames.entries()) {
    assert.deepEqual(atOnce[i], await read(late)(name, frame), `${name}, frame ${frame}`);
  }
  assert.deepEqual(atOnce.at(-1), await late.frame(2));
  early.close();
  late.close();
});

test("a script contains the full module for builds without the files", async (context) => {
  const compiled = compiledModules(context);
  const loaded = await freshPackage(packageWithout(context, ".wasm"));
  for (const name of ["geometry", "lossless"]) {
    assert.equal(await framesHash(loaded, name), expectedOf(name)["hash of positions"]);
  }
  assert.deepEqual(new Set(compiled), new Set([FULL]));
});

test("an error names the files of the decoder if they are missing, and the next call tries again", async (context) => {
  const folder = packageWithout(context, "reel_full.wasm", "embedded_module.js");
  const loaded = await freshPackage(folder);
  const advice = { name: "SourceError", message: /reel_full\.wasm.*; serve reel\.wasm and reel_full\.wasm of the/ };
  assert.equal(await framesHash(loaded), expectedOf("geometry")["hash of positions"]);
  await assert.rejects(framesHash(loaded, "lossless"), advice);
  writeFileSync(join(folder, "reel_full.wasm"), "<!doctype html>"); // as servers of single-page applications do
  await assert.rejects(framesHash(loaded, "lossless"), /reel_full\.wasm is not WebAssembly\); serve/);
  cpSync(join(DIST, "reel_full.wasm"), join(folder, "reel_full.wasm"));
  assert.equal(await framesHash(loaded, "lossless"), expectedOf("lossless")["hash of positions"]);
});

test("an error names the missing feature when the engine lacks SIMD or DecompressionStream", async (context) => {
  const folder = packageWithout(context, ".wasm");
  const open = async (from) => framesHash(await freshPackage(from));
  const { DecompressionStream } = globalThis;
  globalThis.DecompressionStream = undefined;
  try {
    await open(); // only the script with the module needs it
    await assert.rejects(open(folder), { name: "MeshReelError", message: /lacks DecompressionStream; decoding needs/ });
  } finally {
    globalThis.DecompressionStream = DecompressionStream;
  }
  context.mock.method(WebAssembly, "compile", () => Promise.reject(new WebAssembly.CompileError("invalid opcode")));
  await assert.rejects(open(), { name: "CompileError", message: /Content-Security-Policy.*invalid opcode/ });
  context.mock.method(WebAssembly, "validate", () => false);
  await assert.rejects(open(), { name: "MeshReelError", message: /lacks WebAssembly SIMD; decoding needs/ });
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
