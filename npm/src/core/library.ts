// The C library in a page: its functions, its memory, and the bytes of one file.

import {
  CorruptStreamError,
  InvalidInputError,
  MemoryLimitError,
  MeshReelError,
  TruncatedStreamError,
  UnsupportedVersionError,
} from "../errors.js";
import { Heap } from "./heap.js";
import { Struct } from "./struct.js";

/** MESHREEL_ABI of the `include/meshreel.h` that this package is written for. */
const ABI = 1;

const ERROR_BYTES = 32;
const [NO_MEMORY, UNREADABLE, LIMIT] = [1, 7, 9];

/** Classes of the other values of `meshreel_code`. */
const CLASSES = new Map([
  [2, TruncatedStreamError],
  [3, CorruptStreamError],
  [5, UnsupportedVersionError],
]);

/** Functions of core/compile.py's PAGE_FUNCTIONS; addresses and counts are numbers. */
interface Functions {
  readonly memory: WebAssembly.Memory;
  readonly __heap_base: WebAssembly.Global;
  meshreel_abi(): number;
  meshreel_info_of(file: number): number;
  meshreel_surface_of(file: number): number;
  meshreel_triangles(file: number): number;
  meshreel_block_of(file: number, block: number, track: number, found: number): number;
  meshreel_track_of(file: number, track: number, found: number): number;
  page_open(
    size: number,
    memory: number,
    segment: number,
    file: number,
    error: number,
  ): number;
  meshreel_read_surface(file: number, error: number): number;
  meshreel_begin(file: number, decoder: number, error: number): number;
  meshreel_load(
    decoder: number,
    track: number,
    block: number,
    nModes: number,
    error: number,
  ): number;
  meshreel_modes_of(
    decoder: number,
    track: number,
    block: number,
    modes: number,
    error: number,
  ): number;
  meshreel_decode(
    decoder: number,
    track: number,
    first: number,
    count: number,
    nModes: number,
    layout: number,
    values: number,
    error: number,
  ): number;
}

/** Bytes of the file that have been fetched. */
export interface Bytes {
  /** Fill `into` with the bytes from `start`; returns false if some have not been fetched. */
  copy(start: number, into: Uint8Array): boolean;
  has(start: number, end: number): boolean;
}

/** Thrown by a call that needs bytes: fetch them, and repeat it. */
export class MissingBytes extends Error {
  constructor(
    readonly start: number,
    readonly end: number,
  ) {
    super(`bytes ${start} to ${end} are missing`);
  }
}

export class Library {
  readonly functions: Functions;
  readonly heap: Heap;
  private bytes: Bytes | null = null;
  private memoryLimit = 0;

  /** @throws MeshReelError where the module was built from other sources than this package. */
  private constructor(instance: WebAssembly.Instance) {
    this.functions = instance.exports as unknown as Functions;
    const found = this.functions.meshreel_abi();
    if (found !== ABI) {
      throw new MeshReelError(`the decoder has interface ${found}; this meshreel needs ${ABI}`);
    }
    this.heap = new Heap(this.functions.memory, this.functions.__heap_base.value);
  }

  /** An instance of a module that `loadModule` gives. */
  static async start(module: WebAssembly.Module): Promise<Library> {
    let library: Library;
    // Addresses come as signed integers.
    const page = {
      read: (start: number, to: number, size: number): number =>
        Number(!library.bytes?.copy(start, new Uint8Array(library.buffer, to >>> 0, size >>> 0))),
      announce: (start: number, size: number): number =>
        Number(!library.bytes?.has(start, start + size)),
      allocate: (size: number): number => library.heap.take(size >>> 0),
      release: (start: number, size: number): void => library.heap.release(start >>> 0, size >>> 0),
    };
    library = new Library(await WebAssembly.instantiate(module, { page }));
    return library;
  }

  get buffer(): ArrayBuffer {
    return this.functions.memory.buffer as ArrayBuffer;
  }

  /** Call `work`, whose calls of the library read the file from `bytes`; returns its result. */
  reading<Result>(bytes: Bytes, work: () => Result): Result {
    this.bytes = bytes;
    try {
      return work();
    } finally {
      this.bytes = null;
    }
  }

  /** Call `work` with the address of memory that is released afterwards; returns its result. */
  during<Result>(sizeBytes: number, work: (start: number) => Result): Result {
    const start = this.heap.take(sizeBytes);
    if (!start) throw tooLarge(sizeBytes);
    try {
      return work(start);
    } finally {
      this.heap.release(start, sizeBytes);
    }
  }

  /** Open the file of this page, or one of its segments; returns its address. */
  open(sizeBytes: number, memoryLimit: number, segment: number | null): number {
    this.memoryLimit = memoryLimit;
    return this.addressOf((found, error) =>
      this.functions.page_open(sizeBytes, memoryLimit, segment ?? -1, found, error),
    );
  }

  /** The address that a function stores; throws as `check`. */
  addressOf(call: (found: number, error: number) => number): number {
    return this.during(8, (found) => {
      this.check((error) => call(found, error));
      return new Uint32Array(this.buffer, found, 1)[0];
    });
  }

  /**
   * Call a function that gets the address of a `meshreel_error` and returns a code.
   *
   * @throws MissingBytes if bytes of the file have to be fetched.
   * @throws MeshReelError of the class of the code.
   */
  check(call: (error: number) => number): void {
    this.during(ERROR_BYTES, (error) => {
      if (!call(error)) return;
      const fields = new Struct(this.buffer, error);
      const [code] = fields.uint32s(2);
      const [offset, size] = [fields.uint64(), fields.uint64()];
      if (code === UNREADABLE) throw new MissingBytes(offset, offset + size);
      if (code === LIMIT) {
        throw new MemoryLimitError(
          `decoding takes ${size} bytes of memory; ${this.memoryLimit} are allowed: open it with ` +
            "more `memory`",
        );
      }
      if (code === NO_MEMORY) throw tooLarge(size);
      const place = offset < 2 ** 53 ? ` (byte ${offset})` : "";
      throw new (CLASSES.get(code) ?? InvalidInputError)(fields.message() + place);
    });
  }
}

function tooLarge(sizeBytes: number): MeshReelError {
  return new MeshReelError(`decoding takes ${sizeBytes} bytes, which this page does not have`);
}
