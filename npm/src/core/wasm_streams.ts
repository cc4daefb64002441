// Restores a WebAssembly module from separate streams; wasm_streams.mjs describes the format.

const N_STREAMS = 12;
const [BEFORE, AFTER, DICTIONARY, CODE, BYTES, LABELS] = [0, 1, 2, 3, 4, 7];
const MAX_LOCALS = 50_000; // of engines

/**
 * Return the module from the output of `separateStreams`.
 *
 * It runs once, mostly before it is compiled: one function on plain arrays takes a third of the time
 * of readers as objects.
 */
export function joinStreams(packed: Uint8Array): Uint8Array<ArrayBuffer> {
  const next: number[] = []; // by stream: position of the next byte
  const ends: number[] = [];
  let at = 0;
  const readNumber = (): number => {
    const byte = packed[at++];
    return byte < 128 ? byte : byte - 128 + 128 * readNumber();
  };
  const module = new Uint8Array(readNumber());
  for (let stream = 0; stream < N_STREAMS; stream++) {
    const size = readNumber();
    next.push(at);
    ends.push((at += size));
  }
  const opcodes: number[] = []; // positions of the entries of the dictionary
  for (at = next[DICTIONARY]; at < ends[DICTIONARY]; ) {
    opcodes.push(at);
    at += packed[at] + 1;
    at += packed[at] + 1;
  }
  module.set(packed.subarray(next[BEFORE], ends[BEFORE]));
  let size = ends[BEFORE] - next[BEFORE];
  const recentLocals = new Uint16Array(MAX_LOCALS);
  let nLocals = 0;
  for (let position = next[CODE]; position < ends[CODE]; position++) {
    const entry = packed[position];
    if (!entry) nLocals = 0;
    at = opcodes[entry];
    for (let n = packed[at++]; n; n--) module[size++] = packed[at++];
    for (let n = packed[at++]; n; n--) {
      const stream = packed[at++];
      if (stream === BYTES) {
        for (let count = packed[next[BYTES]++]; count; count--) module[size++] = packed[next[BYTES]++];
        continue;
      }
      const start = size;
      do module[size++] = packed[next[stream]++];
      while (module[size - 1] > 127);
      if (stream >= LABELS) continue;
      let rank = 0;
      while (size > start) rank = 128 * rank + (module[--size] & 127);
      for (; nLocals <= rank; nLocals++) recentLocals[nLocals] = nLocals;
      const local = recentLocals[rank];
      recentLocals.copyWithin(1, 0, rank);
      recentLocals[0] = local;
      let rest = local;
      for (; rest > 127; rest >>= 7) module[size++] = 128 | (rest & 127);
      module[size++] = rest;
    }
  }
  module.set(packed.subarray(next[AFTER], ends[AFTER]), size);
  return module;
}
