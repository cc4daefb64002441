// The streams of conformance/ and their expected values.

import { createHash } from "node:crypto";
import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { PACKAGE } from "./bundle.mjs";

const FOLDER = join(PACKAGE, "../conformance/streams");

const all = readdirSync(FOLDER)
  .filter((file) => file.endsWith(".reel"))
  .map((file) => file.slice(0, -".reel".length));

/** Return the expected values of a stream. */
export function expectedOf(name) {
  return JSON.parse(readFileSync(join(FOLDER, `${name}.json`), "utf8"));
}

/** Read a stream. */
export function streamBytes(name) {
  return new Uint8Array(readFileSync(join(FOLDER, `${name}.reel`)));
}

const SEGMENTS = join(PACKAGE, "../conformance/segments");

/** Read a stream of several segments. */
export function segmentedBytes(name) {
  return new Uint8Array(readFileSync(join(SEGMENTS, `${name}.reel`)));
}

/** Return the expected values of its segments. */
export function expectedSegments(name) {
  return JSON.parse(readFileSync(join(SEGMENTS, `${name}.json`), "utf8")).segments;
}

/** Names of streams with modes, with exact positions, both, and of other methods. */
export const REELS = all.filter((name) => expectedOf(name).method === "reel");
export const EXACTS = all.filter((name) => ["lossless", "grid"].includes(expectedOf(name).method));
export const PLAYED = [...REELS, ...EXACTS];
export const OTHERS = all.filter((name) => !PLAYED.includes(name));

/** Expected number of frames of each of `info.blocks`. */
export function blockLengths({ method, blocks }) {
  const maxFrames = method === "reel" ? Infinity : 32;
  return blocks.flatMap(({ frames }) => {
    const parts = [];
    for (let left = frames; left > 0; left -= maxFrames) parts.push(Math.min(left, maxFrames));
    return parts;
  });
}

/** SHA-256 of concatenated arrays. */
export function sha(...arrays) {
  const hash = createHash("sha256");
  for (const array of arrays) {
    hash.update(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
  }
  return hash.digest("hex");
}

/** SHA-256 of integers as int64. */
export function integerHash(integers) {
  return sha(BigInt64Array.from(integers, BigInt));
}
