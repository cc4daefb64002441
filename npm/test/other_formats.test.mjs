// Errors name the format of files that are no .reel files.

import assert from "node:assert/strict";
import { test } from "node:test";

import { ReelFile } from "../dist/index.js";

const MESSAGES = {
  "<!DOCTYPE html><title>404</title>": /HTML page; check the address/,
  "\n<html>": /HTML page/,
  glTF: /GLB file; convert it with `meshreel encode`/,
  "version https://git-lfs.github.com/spec/v1": /Git LFS pointer/,
  "\x1f\x8b\x08": /compressed by gzip/,
  "body { margin: 0 }": /not a \.reel stream|not a \.reel file/,
};

for (const [text, message] of Object.entries(MESSAGES)) {
  test(`the error for a file that begins with ${JSON.stringify(text)} names its format`, async () => {
    const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
    await assert.rejects(ReelFile.open(bytes), { name: "CorruptStreamError", message });
  });
}
