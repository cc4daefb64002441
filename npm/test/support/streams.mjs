// The streams of conformance/, and what is said of them.

import { createHash } from "node:crypto";
import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { PACKAGE } from "./bundle.mjs";

const FOLDER = join(PACKAGE, "../conformance/streams");

const all = readdirSync(FOLDER)
  .filter((file) => file.endsWith(".reel"))
  .map((file) => file.slice(0, -".reel".length));

/** What is said of a stream. */
export function said(name) {
  return JSON.parse(readFileSync(join(FOLDER, `${name}.json`), "utf8"));
}

/** The bytes of a stream. */
export function bytesOf(name) {
  return new Uint8Array(readFileSync(join(FOLDER, `${name}.reel`)));
}

/** Names of the streams whose positions have modes, and are exact: pages decode both; of the others. */
export const REELS = all.filter((name) => said(name).method === "reel");
export const EXACTS = all.filter((name) => ["lossless", "grid"].includes(said(name).method));
export const PLAYED = [...REELS, ...EXACTS];
export const OTHERS = all.filter((name) => !PLAYED.includes(name));

/** Frames in each of `info.blocks`, of what is said of a stream. */
export function framesOfBlocks({ method, blocks }) {
  const most = method === "reel" ? Infinity : 32;
  return blocks.flatMap(({ frames }) => {
    const parts = [];
    for (let left = frames; left > 0; left -= most) parts.push(Math.min(left, most));
    return parts;
  });
}

/** SHA-256 of arrays, one after another. */
export function sha(...arrays) {
  const hash = createHash("sha256");
  for (const array of arrays) {
    hash.update(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
  }
  return hash.digest("hex");
}

/** SHA-256 of integers, as of numbers of 64 bits. */
export function hashOf(integers) {
  return sha(BigInt64Array.from(integers, BigInt));
}
