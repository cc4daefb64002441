// Integers of 64 bits as the core takes them.

/** Little-endian integers of 64 bits of numbers from 0 to 2^53. */
export function int64s(numbers: ArrayLike<number>): Uint32Array {
  const words = new Uint32Array(2 * numbers.length);
  for (let i = 0; i < numbers.length; i++) {
    words[2 * i] = numbers[i];
    words[2 * i + 1] = numbers[i] / 2 ** 32;
  }
  return words;
}
