// Errors name the kind of a file that is no stream.

import assert from "node:assert/strict";
import { test } from "node:test";

import { moduleOf } from "./three_modules.mjs";

const { readHeader } = await moduleOf("../stream/header");

const KINDS = {
  "<!DOCTYPE html><title>404</title>": /HTML page; is the address right\?/,
  "\n<html>": /HTML page/,
  glTF: /GLB file; `meshreel encode` makes a \.reel of it/,
  "version https://git-lfs.github.com/spec/v1": /Git LFS pointer/,
  "\x1f\x8b\x08": /compressed by gzip/,
  "body { margin: 0 }": /starts with 62 6f/,
};

for (const [text, words] of Object.entries(KINDS)) {
  test(`a file that begins with ${JSON.stringify(text)} has its kind in the error`, () => {
    const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
    assert.throws(() => readHeader(bytes), { name: "CorruptStreamError", message: words });
  });
}
