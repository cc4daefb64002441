// Unpacks the core: LZMA, as build.mjs makes it. What browsers could inflate by themselves would be
// a tenth larger, and would come later, by way of streams.

/** Literals have as contexts so many bits of the byte before; build.mjs packs so. */
const BYTE_BITS = 3;

/** Models of bits by what they say; each is the place of its first. */
const STATES = 12;
const IS_MATCH = 0;
const IS_REPEAT = IS_MATCH + STATES;
const IS_OLDER = IS_REPEAT + STATES; // by how much older: the last but one, but two, but three
const IS_LONG = IS_OLDER + 3 * STATES;
const SLOTS = IS_LONG + STATES;
const LOW_BITS = SLOTS + 4 * 64;
const ALIGNED = LOW_BITS + 128;
const LENGTHS = ALIGNED + 16;
const LENGTHS_AGAIN = LENGTHS + 2 + 8 + 8 + 256;
const LITERALS = LENGTHS_AGAIN + 2 + 8 + 8 + 256;
const N_MODELS = LITERALS + (0x300 << BYTE_BITS);

const EVEN = 1024;
const ONE_BITS = 11;
const LEARNING = 5;

/**
 * What was packed: its size as an integer of four bytes, then what LZMA has made of it, without a
 * header, with positions in no context.
 */
export function unpack(packed: Uint8Array): Uint8Array<ArrayBuffer> {
  const size = new DataView(packed.buffer).getUint32(0, true);
  const out = new Uint8Array(size);
  const models = new Uint16Array(N_MODELS).fill(EVEN);
  const distances = [0, 0, 0, 0];
  const [RANGE, CODE] = [0, 1];
  const coder = Uint32Array.of(0xffffffff, 0); // numbers as large as these are slow elsewhere
  let [place, state] = [5, 0]; // the first byte of LZMA is none
  while (place < 9) coder[CODE] = (coder[CODE] << 8) | packed[place++];

  /** A bit of what is left of the range: those below `zeros` are 0. */
  const decided = (zeros: number): number => {
    const found = coder[CODE] < zeros ? 0 : 1;
    coder[CODE] -= found * zeros;
    coder[RANGE] = found ? coder[RANGE] - zeros : zeros;
    if (coder[RANGE] < 0x1000000) {
      coder[RANGE] <<= 8;
      coder[CODE] = (coder[CODE] << 8) | packed[place++];
    }
    return found;
  };
  const bit = (model: number): number => {
    const chance = models[model];
    const found = decided((coder[RANGE] >>> ONE_BITS) * chance);
    models[model] += found ? -(chance >> LEARNING) : ((1 << ONE_BITS) - chance) >> LEARNING;
    return found;
  };
  const rawBit = (): number => {
    const half = coder[RANGE] >>> 1;
    coder[RANGE] = 2 * half;
    return decided(half);
  };
  /** Bits by those before, the highest first. */
  const tree = (model: number, nBits: number): number => {
    let found = 1;
    for (let i = 0; i < nBits; i++) found = 2 * found + bit(model + found);
    return found - (1 << nBits);
  };
  /** The same, the lowest first. */
  const backwards = (model: number, nBits: number): number => {
    let [path, found] = [1, 0];
    for (let i = 0; i < nBits; i++) {
      const one = bit(model + path);
      path = 2 * path + one;
      found += one << i;
    }
    return found;
  };
  const length = (model: number): number => {
    if (!bit(model)) return 2 + tree(model + 2, 3);
    return bit(model + 1) ? 18 + tree(model + 18, 8) : 10 + tree(model + 10, 3);
  };
  const distance = (nBytes: number): number => {
    const slot = tree(SLOTS + 64 * Math.min(nBytes - 2, 3), 6);
    if (slot < 4) return slot;
    const nLow = (slot >> 1) - 1;
    const found = (2 + (slot & 1)) << nLow;
    if (slot < 14) return found + backwards(LOW_BITS + found - slot, nLow);
    let raw = 0;
    for (let i = 4; i < nLow; i++) raw = 2 * raw + rawBit();
    return found + 16 * raw + backwards(ALIGNED, 4);
  };

  for (let at = 0; at < size;) {
    if (!bit(IS_MATCH + state)) {
      const model = LITERALS + 0x300 * ((out[at - 1] ?? 0) >> (8 - BYTE_BITS));
      const other = state < 7 ? 0 : out[at - 1 - distances[0]];
      let found = 1;
      for (let i = 7, isSame = state >= 7; i >= 0; i--) {
        const expected = (other >> i) & 1;
        const one = bit(model + found + (isSame ? 0x100 * (1 + expected) : 0));
        isSame &&= one === expected;
        found = 2 * found + one;
      }
      out[at++] = found;
      state = state < 4 ? 0 : state < 10 ? state - 3 : state - 6;
      continue;
    }
    let nBytes: number;
    if (bit(IS_REPEAT + state)) {
      let age = 0;
      while (age < 3 && bit(IS_OLDER + STATES * age + state)) age++;
      if (!age && !bit(IS_LONG + state)) nBytes = 1;
      else nBytes = length(LENGTHS_AGAIN);
      distances.unshift(...distances.splice(age, 1));
      state = state < 7 ? (nBytes === 1 ? 9 : 8) : 11;
    } else {
      nBytes = length(LENGTHS);
      distances.unshift(distance(nBytes));
      distances.length = 4;
      state = state < 7 ? 7 : 10;
    }
    for (; nBytes > 0; nBytes--, at++) out[at] = out[at - 1 - distances[0]];
  }
  return out;
}
