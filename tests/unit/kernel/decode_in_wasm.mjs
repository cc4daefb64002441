// Decodes what test_wasm.py gives by the core as WebAssembly, and tells the hashes of what it finds.

import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";

const [, , modulePath, streamPath] = process.argv;
const stream = JSON.parse(readFileSync(streamPath, "utf8"));
const module = new WebAssembly.Module(readFileSync(modulePath));
if (WebAssembly.Module.imports(module).length) {
  throw new Error("the module needs functions of its surroundings");
}
const core = new WebAssembly.Instance(module).exports;
let top = core.__heap_base.value;

/** Memory for so many bytes, aligned to 64; its address. */
function take(size) {
  const start = Math.ceil(top / 64) * 64;
  top = start + size;
  const missing = top - core.memory.buffer.byteLength;
  if (missing > 0) {
    core.memory.grow(Math.ceil(missing / 65536));
  }
  return start;
}

function put(bytes) {
  const start = take(bytes.byteLength);
  new Uint8Array(core.memory.buffer).set(
    new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength), start);
  return start;
}

function view(start, size) {
  return new Uint8Array(core.memory.buffer, start, size);
}

function hash(start, size) {
  return createHash("sha256").update(view(start, size)).digest("hex");
}

/** Calls a function with memory of the size that the core states. */
function call(name, sizes, ...others) {
  const size = core[`${name.replace("_decode", "")}_memory`]
    ? core[`${name.replace("_decode", "")}_memory`](...sizes.map(BigInt))
    : core[`${name}_memory`](...sizes.map(BigInt));
  const result = core[name](take(size), size, ...others);
  if (result < 0n) {
    throw new Error(`${name}: ${result}`);
  }
  return Number(result);
}

const { n_verts: V, n_faces: M, n_modes: K, n_frames: T, stencil_size: S } = stream;
const bytes = (name) => Buffer.from(stream[name], "base64");
const [v, m, k, t, s] = [V, M, K, T, S].map(BigInt);

const coded = bytes("connectivity");
const faces = take(12 * M);
call("reel_connectivity_decode", [V, M], put(coded), coded.length, v, m, faces);

const starts = take(4 * (V + 1));
const near = take(24 * M);
const nNear = call("reel_adjacency", [V, M], faces, m, v, starts, near);
const order = take(4 * V);
const levelStarts = take(4 * 62);
const resolutions = take(4 * 61);
const smoothStarts = take(8 * 61);
const stencil = take(4 * V * S);
const hops = take(V * S);
const contexts = take(32 * V);
const smooth = take(256 * V);
const nLevels = call("reel_hierarchy", [V, nNear], starts, near, v, s, order, levelStarts,
  resolutions, smoothStarts, stencil, hops, contexts, smooth);

const columns = put(Int32Array.from({ length: V }, (_, i) => i));
const passes = put(BigInt64Array.from([0n, v]));
const none = put(new BigInt64Array(V + 1));
const residuals = take(4 * K * V);
const fieldBytes = bytes("fields");
call("reel_fields_decode", [V, 1, 0], put(fieldBytes), fieldBytes.length, k, k, v, columns,
  passes, 1n, none, none, residuals);

const values = take(8 * V * K);
const mesh = take(64);
const fields = take(64);
let place = new DataView(core.memory.buffer);
[V, nLevels, S].forEach((n, i) => place.setBigInt64(mesh + 8 * i, BigInt(n), true));
[levelStarts, smoothStarts, stencil, hops, smooth].forEach(
  (n, i) => place.setUint32(mesh + 24 + 4 * i, n, true));
[V, K, K, 0].forEach((n, i) => place.setBigInt64(fields + 8 * i, BigInt(n), true));
[residuals, values, 0, 0].forEach((n, i) => place.setUint32(fields + 32 + 4 * i, n, true));
if (core.reel_predict_decode(mesh, fields, 0n, v) !== 0n) {
  throw new Error("reel_predict_decode");
}

const times = take(12 * K * T);
const timeBytes = bytes("times");
call("reel_integers_decode", [1], put(timeBytes), timeBytes.length,
  put(BigInt64Array.from([3n * k * t])), put(Int32Array.from([0])), 1n, 1n, times);
const basis = take(24 * K * T);
call("reel_basis", [3, T], times, k, 3n, t, 0, 0n, 0, 0n, basis);

const wanted = put(Int32Array.from({ length: T }, (_, i) => i));
const placement = put(Float64Array.from(stream.placement));
const positions = take(12 * T * V);
const packed = take(core.reel_packed_bytes(k, v, 4n) >>> 0);
if (core.reel_pack(values, 1n, k, 1.0, 4n, 0, k, v, 0n, v, packed) !== 0n) throw new Error("reel_pack");
call("reel_frames", [3, K, T], basis, packed, 4n, 3n, t, k, v, wanted, t, 0, 0, 0, placement, 4n,
  positions);

console.log(JSON.stringify({
  faces: hash(faces, 12 * M),
  values: hash(values, 8 * V * K),
  positions: hash(positions, 12 * T * V),
  memory_bytes: top,
}));
