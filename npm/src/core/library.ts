// Binding of the C library: its functions, its memory, and access to the bytes of one file.

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

/** The MESHREEL_ABI of `include/meshreel.h` that this package supports. */
const ABI = 1;

const ERROR_BYTES = 32;
const [NO_MEMORY, UNREADABLE, LIMIT, INCOMPLETE] = [1, 7, 9, 100];

/** Error classes of the other values of `meshreel_code`; default: InvalidInputError. */
const ERROR_CLASSES = new Map([
  [2, TruncatedStreamError],
  [3, CorruptStreamError],
  [5, UnsupportedVersionError],
]);

/** Exports of the module: PAGE_FUNCTIONS in core/compile.py. Addresses and counts are numbers. */
interface Functions {
  readonly memory: WebAssembly.Memory;
  readonly __heap_base: WebAssembly.Global;
  meshreel_abi(): number;
  meshreel_info_of(file: number): number;
  meshreel_times_of(file: number): number;
  meshreel_surface_of(file: number): number;
  meshreel_triangles(file: number): number;
  meshreel_cells_of(file: number): number;
  meshreel_block_of(file: number, block: number, track: number, found: number): number;
  meshreel_track_of(file: number, track: number, found: number): number;
  page_open(size: number, memory: number, file: number, error: number): number;
  page_check_image(file: number, number: number, error: number): number;
  meshreel_segment_of(file: number, number: number, found: number): number;
  meshreel_open_segment(file: number, number: number, segment: number, error: number): number;
  meshreel_close(file: number): void;
  meshreel_read_surface(file: number, error: number): number;
  meshreel_begin(file: number, decoder: number, error: number): number;
  meshreel_end(decoder: number): void;
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
  reel_cell_size(type: bigint): bigint;
  reel_cells_memory(nCells: bigint, nVerts: bigint): number;
  reel_cells_surface(
    memory: number,
    memorySize: number,
    types: number,
    nCells: bigint,
    nodes: number,
    nNodes: bigint,
    nVerts: bigint,
    capacity: bigint,
    triangles: number,
    sizes: number,
    owners: number,
    nPolygons: number,
  ): bigint;
}

/** The bytes of a file that have been fetched so far. */
export interface Bytes {
  /** Copy bytes from position `start` to `into`; returns false if some have not been fetched. */
  copy(start: number, into: Uint8Array): boolean;
  has(start: number, end: number): boolean;
}

/** Thrown when decoding needs bytes that have not been fetched: fetch them, then repeat the call. */
export class MissingBytes extends Error {
  constructor(
    readonly start: number,
    readonly end: number,
  ) {
    super(`bytes ${start} to ${end} are missing`);
  }
}

/** Thrown by the module that decodes only meshes, when a file needs the other. */
export class IncompleteModule extends Error {
  override name = "IncompleteModule";
}

/** An instance of the C library; serves one file. */
export class Library {
  readonly functions: Functions;
  readonly heap: Heap;
  private bytes: Bytes | null = null;
  private memoryLimit = 0;

  /** @throws MeshReelError if the ABI of the module differs from that of this package. */
  private constructor(instance: WebAssembly.Instance) {
    this.functions = instance.exports as unknown as Functions;
    const abi = this.functions.meshreel_abi();
    if (abi !== ABI) {
      throw new MeshReelError(`the decoder has ABI ${abi}; this package needs ABI ${ABI}`);
    }
    this.heap = new Heap(this.functions.memory, this.functions.__heap_base.value);
  }

  /** Instantiate a module returned by `loadModule`. */
  static async instantiate(module: WebAssembly.Module): Promise<Library> {
    let library: Library;
    // WebAssembly passes addresses as signed integers.
    const page = {
      read: (start: number, to: number, size: number): number =>
        Number(!library.bytes?.copy(start, new Uint8Array(library.buffer, to >>> 0, size >>> 0))),
      announce: (start: number, size: number): number =>
        Number(!library.bytes?.has(start, start + size)),
      allocate: (size: number): number => library.heap.allocate(size >>> 0),
      release: (address: number, size: number): void =>
        library.heap.release(address >>> 0, size >>> 0),
    };
    library = new Library(await WebAssembly.instantiate(module, { page }));
    return library;
  }

  get buffer(): ArrayBuffer {
    return this.functions.memory.buffer as ArrayBuffer;
  }

  /** Call `work` with `bytes` as the file that the library reads; returns its result. */
  withBytes<Result>(bytes: Bytes, work: () => Result): Result {
    this.bytes = bytes;
    try {
      return work();
    } finally {
      this.bytes = null;
    }
  }

  /** Call `work` with the address of temporary memory; returns its result. */
  withMemory<Result>(sizeBytes: number, work: (address: number) => Result): Result {
    const address = this.heap.allocate(sizeBytes);
    if (!address) throw outOfMemory(sizeBytes);
    try {
      return work(address);
    } finally {
      this.heap.release(address, sizeBytes);
    }
  }

  /** Open the file; returns the address of the `meshreel_file`. */
  open(sizeBytes: number, memoryLimit: number): number {
    this.memoryLimit = memoryLimit;
    return this.callForAddress((out, error) =>
      this.functions.page_open(sizeBytes, memoryLimit, out, error),
    );
  }

  /** Call a function that stores an address at `out`; returns that address. Throws as `check`. */
  callForAddress(call: (out: number, error: number) => number): number {
    return this.withMemory(8, (out) => {
      this.check((error) => call(out, error));
      return new Uint32Array(this.buffer, out, 1)[0];
    });
  }

  /**
   * Call a function that takes the address of a `meshreel_error` and returns a `meshreel_code`.
   *
   * @throws MissingBytes if bytes of the file must be fetched first.
   * @throws MeshReelError for every other code, of the class that belongs to it.
   */
  check(call: (error: number) => number): void {
    this.withMemory(ERROR_BYTES, (error) => {
      if (!call(error)) return;
      const fields = new Struct(this.buffer, error);
      const [code] = fields.uint32s(2);
      const [offset, size] = [fields.uint64(), fields.uint64()];
      if (code === UNREADABLE) throw new MissingBytes(offset, offset + size);
      if (code === LIMIT) {
        throw new MemoryLimitError(
          `decoding needs ${size} bytes of memory; the limit is ${this.memoryLimit}: open the file ` +
          "with a larger `memory`",
        );
      }
      if (code === NO_MEMORY) throw outOfMemory(size);
      if (code === INCOMPLETE) throw new IncompleteModule();
      const place = offset < 2 ** 53 ? ` (byte ${offset})` : "";
      throw new (ERROR_CLASSES.get(code) ?? InvalidInputError)(fields.cString() + place);
    });
  }
}

function outOfMemory(sizeBytes: number): MeshReelError {
  return new MeshReelError(`decoding needs ${sizeBytes} bytes, more than are available`);
}
