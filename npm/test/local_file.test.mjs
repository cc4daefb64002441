// Local files in Node, opened by paths and `file:` URLs, and how bundlers for browsers treat them.

import assert from "node:assert/strict";
import { appendFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, relative } from "node:path";
import { after, test } from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";
import { build } from "esbuild";

import { ReelFile, SourceError } from "../dist/index.js";
import { PACKAGE } from "./support/bundle.mjs";
import { streamBytes, expectedOf, sha } from "./support/streams.mjs";
import { largeTracks } from "./support/track_streams.mjs";

const FOLDER = mkdtempSync(join(tmpdir(), "meshreel files "));
after(() => rmSync(FOLDER, { recursive: true }));

/** Write a file and return its URL. */
function writeTemporary(name, bytes) {
  const path = join(FOLDER, name);
  writeFileSync(path, bytes);
  return pathToFileURL(path);
}

for (const [what, convert] of [
  ["a URL object", (url) => url],
  ["a string", String],
  ["a path", fileURLToPath],
  ["a relative path", (url) => relative(process.cwd(), fileURLToPath(url))],
]) {
  test(`frames of a file opened by ${what} are right`, async () => {
    const name = "blocks";
    const reel = await ReelFile.open(convert(writeTemporary("größe 100%.reel", streamBytes(name))));
    const frames = [];
    for (let index = 0; index < reel.info.nFrames; index++) frames.push(await reel.frame(index));
    reel.close();
    assert.equal(sha(...frames), expectedOf(name)["hash of positions"]);
  });
}

test("a file is only read partially", async (context) => {
  const bytes = largeTracks();
  const url = writeTemporary("large.reel", bytes);
  let nRead = 0;
  const { slice } = Blob.prototype;
  context.mock.method(Blob.prototype, "slice", function (start, end) {
    nRead += end - start;
    return slice.call(this, start, end);
  });
  const reel = await ReelFile.open(url);
  await reel.frame(0);
  reel.close();
  assert.ok(nRead > 0 && nRead < bytes.length, `${nRead} of ${bytes.length} bytes were read`);
});

test("a missing file is an error that contains its path", async () => {
  const path = join(FOLDER, "missing.reel");
  await assert.rejects(ReelFile.open(pathToFileURL(path)), (error) => {
    assert.ok(error instanceof SourceError, String(error));
    assert.ok(error.message.includes(path) && /ENOENT.*check the path/.test(error.message));
    return true;
  });
});

test("a folder and a URL without a valid path are errors", async () => {
  await assert.rejects(ReelFile.open(pathToFileURL(FOLDER)), { name: "SourceError", message: /check/ });
  await assert.rejects(ReelFile.open("file://host.example/a%2Fb"), { name: "SourceError" });
  await assert.rejects(ReelFile.open("no.reel"), { name: "SourceError", message: /no\.reel.*ENOENT.*check/ });
  await assert.rejects(ReelFile.open("http://["), { name: "InvalidInputError", message: /in Node/ });
});

test("reading a changed or closed file is an error", async () => {
  const url = writeTemporary("changed.reel", largeTracks());
  const reel = await ReelFile.open(url);
  appendFileSync(url, "more");
  await assert.rejects(reel.frame(reel.info.nFrames - 1), { name: "SourceError", message: /has changed.*open it again/ });
  reel.close();
  await assert.rejects(reel.frame(0), { name: "AbortError" });
});

test("aborting while a file is opened throws the reason", async () => {
  const url = writeTemporary("aborted.reel", streamBytes("sphere"));
  const controller = new AbortController();
  const opening = ReelFile.open(url, { signal: controller.signal });
  controller.abort(new Error("enough"));
  await assert.rejects(opening, /enough/);
});

test("comments keep bundlers from resolving the import of Node's files", () => {
  for (const name of ["index.js", "player.js"]) {
    const script = readFileSync(join(PACKAGE, "dist", name), "utf8");
    assert.match(script, /import\(\s*\/\* webpackIgnore: true \*\/\s*\/\* @vite-ignore \*\//);
  }
});

test("a bundle for browsers resolves without the modules of Node", async () => {
  for (const entry of ["index.js", "player.js"]) {
    const { warnings } = await build({
      entryPoints: [join(PACKAGE, "dist", entry)],
      bundle: true,
      platform: "browser",
      format: "esm",
      splitting: true,
      outdir: "unused",
      write: false,
      logLevel: "silent",
    });
    const serious = warnings.filter(({ id }) => id !== "ignored-bare-import");
    assert.deepEqual(serious, []);
  }
});
