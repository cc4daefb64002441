// A `.reel` that is open: its frames when they are asked for.

import { loadModule } from "../core/module.js";
import { CorruptStreamError, InvalidInputError } from "../errors.js";
import { filled, requireFitting, requireNumber } from "./arguments.js";
import { openSource, type SourceInput, type SourceOptions } from "../source/open.js";
import type {
  BlockFields,
  ByteSource,
  OpenReel,
  Positions,
  ReelInfo,
  Surface,
} from "../types.js";
import { startEngine } from "./engine_function.js";
import { type CallOptions, ReelTrack } from "./reel_track.js";
import { RemoteEngine } from "./remote_engine.js";

/** Bytes that decoding may take at once where no limit is given: 2 GiB. */
const DEFAULT_MEMORY = 2 ** 31;

/** Columns of positions. */
const COLUMNS = [0, 1, 2];

/** How a file is opened. */
export interface OpenOptions extends SourceOptions {
  /**
   * Whether frames are decoded in a worker, so that the page never waits for them. Default: true;
   * where there are no workers, as in Node, or a content policy has no `worker-src blob:`, they are
   * decoded on the thread that asks; `isInWorker` says which.
   */
  worker?: boolean;
  /**
   * Bytes that decoding may take at once: a small file may be made to exhaust memory. What needs more
   * is refused with a `MemoryLimitError`. Default: 2 GiB.
   */
  memory?: number;
  /**
   * The segment to open of a file that has several, meshes of different connectivity that are shown
   * in order; its frames begin at 0. Without it such a file is refused, with their number.
   */
  segment?: number;
}

/**
 * A `.reel` file that is open.
 *
 * Connectivity and index are read when it is opened, blocks of frames when they are needed; two
 * decoded blocks are kept. Positions are the same bits as those of the Python package. Those of the
 * methods "lossless" and "grid" are decoded by what decodes tracks: see `track`.
 *
 * @example
 * const reel = await ReelFile.open("walk.reel");
 * const positions = await reel.frame(10); // x, y, z of each vertex
 * reel.close();
 */
export class ReelFile implements OpenReel {
  private whole: Promise<RemoteEngine> | null = null;

  private constructor(
    private readonly source: ByteSource,
    private readonly engine: RemoteEngine,
    private readonly options: OpenOptions,
    /** Facts of the file. */
    readonly info: ReelInfo,
    /** What the mesh is beside its positions. */
    readonly surface: Surface,
  ) {}

  /**
   * Opens a file.
   *
   * @param from - An address, whose server is asked for ranges; a response; a blob, such as a file
   *   that was dropped; or bytes, such as a `Buffer` of Node. Bytes are neither changed nor detached,
   *   and must not change as long as the file is open.
   * @throws SourceError where the bytes cannot be had.
   * @throws CorruptStreamError, TruncatedStreamError where they are no `.reel`, or damaged.
   * @throws UnsupportedVersionError where a newer version is needed, or the method is one of the
   *   paper's.
   * @throws MemoryLimitError where the mesh takes more than `memory`; frames and values throw it of
   *   blocks.
   * @throws WebAssembly.CompileError where the content policy of the page forbids WebAssembly; it
   *   has to allow `script-src 'wasm-unsafe-eval'`.
   */
  static async open(from: SourceInput, options: OpenOptions = {}): Promise<ReelFile> {
    const { worker: inWorker = true, memory = DEFAULT_MEMORY, segment = null } = options;
    if (segment !== null && !(Number.isInteger(segment) && segment >= 0)) {
      throw new InvalidInputError(`segment must be a number from 0 up; got ${segment}`);
    }
    // All that decodes gets ready while bytes are on their way.
    const opening = openSource(from, options);
    const engine = new RemoteEngine(startEngine, opening, inWorker);
    try {
      const [source] = await Promise.all([opening, engine.begin(loadModule("positions"))]);
      const { size, hasRanges } = source;
      const { info, surface } = await engine.ask("open", { size, hasRanges, memory, segment }, options.signal);
      return new ReelFile(source, engine, options, info, surface);
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
    requireFitting(into, numberType, 3 * nVerts);
    const engine = await this.positions();
    return filled(into, (await engine.ask("frame", { track: 0, number }, signal)) as Positions);
  }

  /**
   * A track, whose values come when they are asked for.
   *
   * A separate module and worker decode tracks; they are loaded with the first values, and positions
   * never wait for them. Only bytes of requested tracks are read.
   *
   * @example
   * const stress = reel.track("stress");
   * const values = await stress.frame(10); // info.nColumns numbers of each of info.nItems
   *
   * @throws InvalidInputError where there is none.
   * @throws CorruptStreamError where two tracks of the file have one name.
   */
  track(name: string): ReelTrack {
    const { tracks } = this.info;
    const number = tracks.findIndex((one) => one.name === name);
    if (number < 0) {
      const names = tracks.map((one) => JSON.stringify(one.name)).join(", ") || "none";
      throw new InvalidInputError(`there is no track ${JSON.stringify(name)}; there are: ${names}`);
    }
    if (new Set(tracks.map((one) => one.name)).size < tracks.length) {
      throw new CorruptStreamError("two tracks of the stream have one name");
    }
    return new ReelTrack(this.info, number, () => this.wholeEngine());
  }

  /**
   * A block of frames as small integers, for shaders.
   *
   * @param block - Number of the block in `info.blocks`, from 0 on.
   * @throws InvalidInputError, CorruptStreamError, SourceError as `frame`.
   */
  async fields(block: number, { signal }: CallOptions = {}): Promise<BlockFields> {
    requireNumber("block", block, this.info.blocks.length);
    const engine = await this.positions();
    return engine.ask("fields", { track: 0, block, columns: COLUMNS }, signal);
  }

  /** Whether frames are decoded in a worker, and not on the thread that asks. */
  get isInWorker(): boolean {
    return this.engine.isInWorker;
  }

  /** Lets all memory and connections go. Calls that are under way throw an `AbortError`. */
  close(): void {
    const reason = new DOMException("The file was closed", "AbortError");
    this.engine.close(reason);
    this.whole?.then((engine) => engine.close(reason)).catch(() => {});
    this.source.close();
  }

  /** What decodes positions. */
  private positions(): RemoteEngine | Promise<RemoteEngine> {
    return this.info.method === "reel" ? this.engine : this.wholeEngine();
  }

  /** What decodes everything. */
  private wholeEngine(): Promise<RemoteEngine> {
    this.whole ??= this.openWhole().catch((error: unknown) => {
      this.whole = null; // the script may come another time
      throw error;
    });
    return this.whole;
  }

  private async openWhole(): Promise<RemoteEngine> {
    const { size, hasRanges } = this.source;
    const { worker: inWorker = true, memory = DEFAULT_MEMORY, segment = null } = this.options;
    const [module, ranges] = await Promise.all([
      loadModule("whole"),
      this.engine.ask("ranges", {}),
    ]);
    const engine = new RemoteEngine(startEngine, Promise.resolve(this.source), inWorker);
    try {
      await engine.begin(Promise.resolve(module));
      await engine.ask("open", { size, hasRanges, memory, segment, ranges });
      return engine;
    } catch (error) {
      engine.close(error);
      throw error;
    }
  }
}
