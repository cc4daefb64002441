// Errors name the kind of a file that is no stream.

import assert from "node:assert/strict";
import { test } from "node:test";

import { ReelFile } from "../dist/index.js";

const KINDS = {
  "<!DOCTYPE html><title>404</title>": /HTML page; is the address right\?/,
  "\n<html>": /HTML page/,
  glTF: /GLB file; `meshreel encode` makes a \.reel of it/,
  "version https://git-lfs.github.com/spec/v1": /Git LFS pointer/,
  "\x1f\x8b\x08": /compressed by gzip/,
  "body { margin: 0 }": /not a \.reel stream/,
};

for (const [text, words] of Object.entries(KINDS)) {
  test(`a file that begins with ${JSON.stringify(text)} has its kind in the error`, async () => {
    const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
    await assert.rejects(ReelFile.open(bytes), { name: "CorruptStreamError", message: words });
  });
}
