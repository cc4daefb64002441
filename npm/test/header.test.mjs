// The header of a stream: each field where it is, and what is refused.

import assert from "node:assert/strict";
import { test } from "node:test";
import { loadInternals } from "./support/bundle.mjs";

const {
  CorruptStreamError,
  TruncatedStreamError,
  UnsupportedVersionError,
  crc32,
  readHeader,
} = await loadInternals();

const FIXED_BYTES = 68;
const MAX_NAME_BYTES = 4096;
const NAME = new TextEncoder().encode("änne");

/** A header with another number in each field, changed as `change` does with its view. */
function header(change = () => {}, name = NAME, announced = name.length) {
  const data = new Uint8Array(FIXED_BYTES + name.length + 4);
  const view = new DataView(data.buffer);
  data.set([0x89, 0x52, 0x45, 0x45, 0x4c, 0x0d, 0x0a, 0x1a]);
  view.setUint16(8, 3, true);
  [175, 9971, 19938].forEach((count, i) => view.setUint32(10 + 4 * i, count, true));
  view.setFloat64(22, 29.97, true);
  [8, 5, 6, 7].forEach((code, i) => view.setUint8(30 + i, code));
  [1, -2, 3e6, 0.5].forEach((number, i) => view.setFloat64(34 + 8 * i, number, true));
  view.setUint16(66, announced, true);
  data.set(name, FIXED_BYTES);
  change(view);
  view.setUint32(data.length - 4, crc32(data.subarray(0, -4)), true);
  return data;
}

test("each field is read from its place", () => {
  assert.deepEqual(readHeader(new Uint8Array([...header(), 1, 2, 3])), {
    ...{ nFrames: 175, nVerts: 9971, nFaces: 19938, fps: 29.97, vertexType: 8 },
    ...{ method: 5, laplacian: 6, order: 7, origin: [1, -2, 3e6], scale: 0.5 },
    ...{ name: "änne", sizeBytes: FIXED_BYTES + NAME.length + 4 },
  });
});

test("a header that begins anywhere in a buffer is read", () => {
  const data = header();
  const whole = new Uint8Array([1, 2, 3, ...data]);
  assert.deepEqual(readHeader(whole.subarray(3)), readHeader(data));
});

test("least and unknown values are allowed", () => {
  const { nFrames, nVerts, nFaces, fps, name } = readHeader(
    header((view) => {
      [0, 1, 1].forEach((count, i) => view.setUint32(10 + 4 * i, count, true));
      view.setFloat64(22, 0, true);
    }, new Uint8Array()),
  );
  assert.deepEqual([nFrames, nVerts, nFaces, fps, name], [0, 1, 1, 0, ""]);
});

test("a header that is cut anywhere is reported as cut", () => {
  const data = header();
  for (let size = 0; size < data.length; size++) {
    assert.throws(() => readHeader(data.subarray(0, size)), TruncatedStreamError, `${size} bytes`);
  }
});

test("any changed bit is noticed", () => {
  const data = header();
  for (let bit = 0; bit < 8 * data.length; bit++) {
    const changed = data.slice();
    changed[bit >> 3] ^= 1 << (bit & 7);
    assert.throws(() => readHeader(changed), { name: /^(Corrupt|Truncated|Unsupp)/ }, `bit ${bit}`);
  }
});

for (const [what, change] of [
  ["no vertex", (view) => view.setUint32(14, 0, true)],
  ["no face", (view) => view.setUint32(18, 0, true)],
  ["vertex type 5", (view) => view.setUint8(30, 5)],
  ["a negative frame rate", (view) => view.setFloat64(22, -1, true)],
  ["a frame rate that is no number", (view) => view.setFloat64(22, NaN, true)],
  ["an infinite frame rate", (view) => view.setFloat64(22, Infinity, true)],
  ["an origin that is no number", (view) => view.setFloat64(50, NaN, true)],
  ["no size", (view) => view.setFloat64(58, 0, true)],
  ["an infinite size", (view) => view.setFloat64(58, Infinity, true)],
]) {
  test(`${what} is refused`, () => {
    assert.throws(() => readHeader(header(change)), CorruptStreamError);
  });
}

for (const version of [0, 1, 2, 4, 256]) {
  test(`format ${version} is refused`, () => {
    const advice = version === 1 || version === 2 ? /encode the original again/ : /upgrade meshreel/;
    assert.throws(
      () => readHeader(header((view) => view.setUint16(8, version, true))),
      (error) => error instanceof UnsupportedVersionError && advice.test(error.message),
    );
  });
}

test("names are as long as the format allows, and of whole characters", () => {
  const longest = new Uint8Array(MAX_NAME_BYTES).fill(97);
  assert.equal(readHeader(header(undefined, longest)).name.length, MAX_NAME_BYTES);
  const longer = new Uint8Array(MAX_NAME_BYTES + 1).fill(97);
  assert.throws(() => readHeader(header(undefined, longer)), /a name of 4097 bytes; at most 4096/);
  assert.throws(() => readHeader(header(undefined, NAME.subarray(0, 1))), /not UTF-8/);
});
