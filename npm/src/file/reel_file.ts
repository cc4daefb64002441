// A `.reel` that is open: its frames when they are asked for.

import { loadModule } from "../core/module.js";
import type { Positions } from "../decode/frames.js";
import { InvalidInputError } from "../errors.js";
import { openSource, type SourceInput, type SourceOptions } from "../source/open.js";
import type { BlockFields, ByteSource, OpenReel, ReelInfo, Surface } from "../types.js";
import { RemoteEngine } from "./remote_engine.js";

/** How a file is opened. */
export interface OpenOptions extends SourceOptions {
  /**
   * Whether frames are decoded in a worker, so that the page never waits for them. Default: true;
   * where there are no workers, as in Node, or a content policy has no `worker-src blob:`, they are
   * decoded on the thread that asks; `isInWorker` says which.
   */
  worker?: boolean;
}

/** What a call may be given. */
export interface CallOptions {
  /** Takes the question back: the call then throws its reason, an `AbortError` by default. */
  signal?: AbortSignal;
}

/**
 * A `.reel` file that is open.
 *
 * Connectivity and index are read when it is opened, blocks of frames when they are needed; two
 * decoded blocks are kept. Positions are the same bits as those of the Python package.
 *
 * @example
 * const reel = await ReelFile.open("walk.reel");
 * const positions = await reel.frame(10); // x, y, z of each vertex
 * reel.close();
 */
export class ReelFile implements OpenReel {
  private constructor(
    private readonly source: ByteSource,
    private readonly engine: RemoteEngine,
    /** Facts of the file. */
    readonly info: ReelInfo,
    /** What the mesh is beside its positions. */
    readonly surface: Surface,
  ) {}

  /**
   * Opens a file.
   *
   * @param from - An address, whose server is asked for ranges; a response; a blob, such as a file
   *   that was dropped; or bytes.
   * @throws SourceError where the bytes cannot be had.
   * @throws CorruptStreamError, TruncatedStreamError where they are no `.reel`, or damaged.
   * @throws UnsupportedVersionError where a newer version is needed, or the method is not `reel`.
   * @throws WebAssembly.CompileError where the content policy of the page forbids WebAssembly; it
   *   has to allow `script-src 'wasm-unsafe-eval'`.
   */
  static async open(from: SourceInput, options: OpenOptions = {}): Promise<ReelFile> {
    // All that decodes gets ready while bytes are on their way.
    const opening = openSource(from, options);
    const engine = new RemoteEngine(opening, options.worker ?? true);
    try {
      const [source] = await Promise.all([opening, engine.begin(loadModule())]);
      const { size, hasRanges } = source;
      const { info, surface } = await engine.ask("open", { size, hasRanges }, options.signal);
      return new ReelFile(source, engine, info, surface);
    } catch (error) {
      engine.close(error);
      opening.then((source) => source.close()).catch(() => {});
      throw error;
    }
  }

  /**
   * Positions of a frame, of shape (V, 3) in model units: float32 or float64, as in the file.
   *
   * @param number - From 0 on.
   * @param into - Is filled and returned where it is given.
   * @throws InvalidInputError where there is no such frame, or `into` is of another type or length.
   * @throws CorruptStreamError where its block is damaged; others can still be decoded.
   * @throws SourceError where the bytes cannot be had.
   */
  async frame(number: number, into?: Positions, { signal }: CallOptions = {}): Promise<Positions> {
    const { nFrames, nVerts, numberType } = this.info;
    requireNumber("frame", number, nFrames);
    const kind = numberType === "float32" ? Float32Array : Float64Array;
    if (into && !(into instanceof kind && into.length === 3 * nVerts)) {
      throw new InvalidInputError(`into must be a ${kind.name} of ${3 * nVerts} numbers`);
    }
    const positions = await this.engine.ask("frame", { number }, signal);
    if (!into) return positions;
    into.set(positions);
    return into;
  }

  /**
   * A block of frames as small integers, for shaders.
   *
   * @param block - Number of the block, from 0 on.
   * @throws InvalidInputError, CorruptStreamError, SourceError as `frame`.
   */
  async fields(block: number, { signal }: CallOptions = {}): Promise<BlockFields> {
    requireNumber("block", block, this.info.blocks.length);
    return this.engine.ask("fields", { block }, signal);
  }

  /** Whether frames are decoded in a worker, and not on the thread that asks. */
  get isInWorker(): boolean {
    return this.engine.isInWorker;
  }

  /** Lets all memory and connections go. Calls that are under way throw an `AbortError`. */
  close(): void {
    this.engine.close(new DOMException("The file was closed", "AbortError"));
    this.source.close();
  }
}

function requireNumber(what: string, number: number, count: number): void {
  if (!(Number.isInteger(number) && number >= 0 && number < count)) {
    throw new InvalidInputError(`there are ${what}s 0 to ${count - 1}; got ${what} ${number}`);
  }
}
