// Rearranges a WebAssembly module so that it compresses better; src/core/wasm_streams.ts restores it.
//
// Deflate finds few repetitions in code, where opcodes alternate with indices of locals and constants.
// Here opcodes and each kind of immediate have separate streams, and a local is its rank in the order
// of last use: 15 % smaller after deflate.
//
// Format: the size of the module, then all streams, each preceded by its size; numbers are LEB128. The
// dictionary lists opcodes: number of bytes, bytes, number of immediates, and the stream of each. Code
// refers to it by byte. Its first entry begins a function; its immediate is the header.

/** Streams in order. Those from LABELS contain numbers that are copied. */
const [BEFORE, AFTER, DICTIONARY, CODE, BYTES, READ_LOCALS, WRITTEN_LOCALS, LABELS] = [0, 1, 2, 3, 4, 5, 6, 7];
const [FUNCTIONS, OFFSETS, INT32S, INT64S, N_STREAMS] = [8, 9, 10, 11, 12];

const CODE_SECTION = 10;

/** Reads bytes and LEB128 numbers. */
class Reader {
  constructor(bytes, at) {
    this.bytes = bytes;
    this.at = at;
  }

  byte() {
    return this.bytes[this.at++];
  }

  /** An unsigned number; signed ones are only skipped. */
  number() {
    const byte = this.byte();
    return byte < 128 ? byte : byte - 128 + 128 * this.number();
  }

  /** The bytes that `skip` consumes. */
  bytesOf(skip) {
    const start = this.at;
    skip(this);
    return this.bytes.subarray(start, this.at);
  }
}

const byte = (code) => code.byte();
const number = (code) => code.number();
const bytes = (count) => (code) => (code.at += count);

function functionHeader(code) {
  code.number(); // size
  for (let count = code.number(); count > 0; count--) {
    code.number();
    code.byte(); // type
  }
}

function jumpTable(code) {
  for (let count = code.number() + 1; count > 0; count--) code.number();
}

const INT32_CONSTANT = 0x41;

/** Constants that are part of their opcode: the most frequent bytes; 127 is -1. */
const COMMON_CONSTANTS = [0, 1, 2, 3, 4, 8, 16, 127];

/**
 * Opcodes from and to; what follows an opcode and is stored as part of it, because it hardly varies;
 * and the other immediates, with their streams. Opcodes after the prefix 0xfc are 0xfc00 and up.
 */
const INSTRUCTIONS = [
  [0x00, 0x01, [], []], // unreachable, nop
  [0x02, 0x04, [byte], []], // block, loop, if: type of the result
  [0x05, 0x05, [], []], // else
  [0x0b, 0x0b, [], []], // end
  [0x0c, 0x0d, [], [[LABELS, number]]], // br, br_if
  [0x0e, 0x0e, [], [[BYTES, jumpTable]]],
  [0x0f, 0x0f, [], []], // return
  [0x10, 0x10, [], [[FUNCTIONS, number]]], // call
  [0x11, 0x11, [number, number], []], // call_indirect
  [0x1a, 0x1b, [], []], // drop, select
  [0x20, 0x20, [], [[READ_LOCALS, number]]], // local.get
  [0x21, 0x22, [], [[WRITTEN_LOCALS, number]]], // local.set, local.tee
  [0x23, 0x24, [number], []], // globals
  [0x28, 0x3e, [number], [[OFFSETS, number]]], // loads and stores: alignment, offset
  [INT32_CONSTANT, INT32_CONSTANT, [], [[INT32S, number]]],
  [0x42, 0x42, [], [[INT64S, number]]],
  [0x43, 0x43, [], [[BYTES, bytes(4)]]], // f32.const
  [0x44, 0x44, [], [[BYTES, bytes(8)]]], // f64.const
  [0x45, 0xc4, [], []], // comparisons, arithmetic, conversions
  [0xfc00, 0xfc07, [], []], // saturating conversions
  [0xfc0a, 0xfc0a, [byte, byte], []], // memory.copy
  [0xfc0b, 0xfc0b, [byte], []], // memory.fill
  [0xfd00, 0xfd0b, [number], [[OFFSETS, number]]], // loads and stores of vectors
  [0xfd0c, 0xfd0d, [], [[BYTES, bytes(16)]]], // v128.const, i8x16.shuffle
  [0xfd0e, 0xfd14, [], []], // i8x16.swizzle, splats
  [0xfd15, 0xfd22, [byte], []], // lanes
  [0xfd23, 0xfd53, [], []], // comparisons, logic
  [0xfd54, 0xfd5b, [number], [[OFFSETS, number], [BYTES, byte]]], // loads and stores of lanes
  [0xfd5c, 0xfd5d, [number], [[OFFSETS, number]]], // loads with zeros
  [0xfd5e, 0xfdff, [], []], // arithmetic, conversions
];

/** Skip an opcode and what is stored as part of it; returns its other immediates. */
function readInstruction(code) {
  const first = code.byte();
  const opcode = first >= 0xfc ? first * 256 + code.number() : first;
  const found = INSTRUCTIONS.find(([from, to]) => opcode >= from && opcode <= to);
  if (!found) throw new Error(`unknown opcode 0x${opcode.toString(16)} at byte ${code.at}`);
  const [, , inOpcode, immediates] = found;
  for (const skip of inOpcode) skip(code);
  if (opcode === INT32_CONSTANT && COMMON_CONSTANTS.includes(code.bytes[code.at])) {
    code.byte();
    return [];
  }
  return immediates;
}

/** Return the offsets of the first function and of the end of the code. */
function findCode(module) {
  const reader = new Reader(module, 8);
  for (;;) {
    const section = reader.byte();
    const size = reader.number();
    const end = reader.at + size;
    if (section === CODE_SECTION) {
      reader.number(); // functions
      return [reader.at, end];
    }
    reader.at = end;
  }
}

/** Return the streams of a module. */
export function separateStreams(module) {
  const streams = Array.from({ length: N_STREAMS }, () => []);
  const entries = new Map();
  const [start, end] = findCode(module);
  const code = new Reader(module, start);
  let recentLocals = [];

  const addOpcode = (opcode, immediates) => {
    const key = [...opcode].join();
    if (!entries.has(key)) {
      entries.set(key, entries.size);
      const numbers = immediates.map(([stream]) => stream);
      streams[DICTIONARY].push(opcode.length, ...opcode, numbers.length, ...numbers);
    }
    streams[CODE].push(entries.get(key));
    for (const [stream, skip] of immediates) {
      const value = code.bytesOf(skip);
      if (stream === BYTES) streams[stream].push(value.length, ...value);
      else if (stream >= LABELS) streams[stream].push(...value);
      else streams[stream].push(...leb(moveToFront(recentLocals, new Reader(value, 0).number())));
    }
  };

  while (code.at < end) {
    const size = new Reader(module, code.at);
    const functionEnd = size.number() + size.at;
    recentLocals = [];
    addOpcode([], [[BYTES, functionHeader]]);
    while (code.at < functionEnd) {
      let immediates;
      const opcode = code.bytesOf(() => (immediates = readInstruction(code)));
      addOpcode(opcode, immediates);
    }
  }
  if (entries.size > 256) throw new Error(`the module has ${entries.size} opcodes; the limit is 256`);
  streams[BEFORE] = [...module.subarray(0, start)];
  streams[AFTER] = [...module.subarray(end)];
  const sized = streams.flatMap((stream) => [...leb(stream.length), ...stream]);
  return Uint8Array.from([...leb(module.length), ...sized]);
}

function leb(value) {
  return value < 128 ? [value] : [128 + (value % 128), ...leb(Math.floor(value / 128))];
}

/** Move a local to the front of the list, and return its rank before; unused ones are last. */
function moveToFront(recentLocals, local) {
  while (recentLocals.length <= local) recentLocals.push(recentLocals.length);
  const rank = recentLocals.indexOf(local);
  recentLocals.unshift(...recentLocals.splice(rank, 1));
  return rank;
}
