// An instance of the core: its memory, and what its functions say when they fail.

import {
  CorruptStreamError,
  InvalidInputError,
  MeshReelError,
  TruncatedStreamError,
} from "../errors.js";
import type { Functions, SharedFunctions } from "./functions.js";
import { Heap, Scope } from "./heap.js";

/** REEL_ABI of the `core/reel.h` that this package is written for. */
const ABI = 11n;

const TRUNCATED = 2;
const CORRUPT = 3;
const INVALID = 4;

/** The C functions that decode streams, and the linear memory that they work in. */
export class Core<Exports extends SharedFunctions = Functions> {
  readonly functions: Exports;
  readonly heap: Heap;

  /**
   * @param instance - Of the module that `loadModule` gives, or of that for exact values.
   * @throws MeshReelError where it was built from other sources than this package.
   */
  constructor(instance: WebAssembly.Instance) {
    this.functions = instance.exports as unknown as Exports;
    const found = this.functions.reel_abi();
    if (found !== ABI) {
      throw new MeshReelError(`the core has interface ${found}; this meshreel needs ${ABI}`);
    }
    this.heap = new Heap(this.functions.memory, this.functions.__heap_base.value);
  }

  /** What `work` returns; the memory that it takes in its scope is then given back. */
  during<Result>(work: (scope: Scope) => Result): Result {
    const scope = new Scope(this.heap, this.functions.memory);
    try {
      return work(scope);
    } finally {
      scope.close();
    }
  }

  /** As `during`, but what `keep` is told of stays taken, unless `work` throws. */
  keeping<Result>(work: (scope: Scope, keep: (start: number) => number) => Result): Result {
    const scope = new Scope(this.heap, this.functions.memory);
    const kept: number[] = [];
    let isDone = false;
    const keep = (start: number): number => {
      kept.push(start);
      return start;
    };
    try {
      const result = work(scope, keep);
      isDone = true;
      return result;
    } finally {
      scope.close(isDone ? kept : []);
    }
  }

  /**
   * What a function of the core returned, which is at least 0.
   *
   * @param result - As it returned it.
   * @param what - What the bytes hold, in the plural.
   * @throws TruncatedStreamError, CorruptStreamError where bytes that came in are damaged.
   */
  checked(result: bigint, what: string): number {
    if (result >= 0n) return Number(result);
    const code = Number(-result & 0xffn);
    const place = -result >> 8n;
    if (code === TRUNCATED) throw new TruncatedStreamError(`the ${what} are cut off at ${place}`);
    if (code === CORRUPT) {
      throw new CorruptStreamError(`the ${what} are damaged: what stands at ${place} cannot be`);
    }
    if (code === INVALID) {
      throw new InvalidInputError(
        `the ${what} cannot be decoded: number ${place} is beyond the limits`,
      );
    }
    throw new MeshReelError(`the ${what} need more memory than a page can have`);
  }

  bytes(start: number, length: number): Uint8Array {
    return new Uint8Array(this.functions.memory.buffer, start, length);
  }

  int32s(start: number, length: number): Int32Array {
    return new Int32Array(this.functions.memory.buffer, start, length);
  }

  uint32s(start: number, length: number): Uint32Array {
    return new Uint32Array(this.functions.memory.buffer, start, length);
  }

  float32s(start: number, length: number): Float32Array {
    return new Float32Array(this.functions.memory.buffer, start, length);
  }

  float64s(start: number, length: number): Float64Array {
    return new Float64Array(this.functions.memory.buffer, start, length);
  }
}
