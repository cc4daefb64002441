// The engines of an open file.

import type { Calls, Results } from "../engine/messages.js";
import { findReel } from "../source/mp4.js";
import { openSource } from "../source/open.js";
import { DEFAULT_MEMORY, type SourceInput, type SourceOptions } from "../source/transport.js";
import type { ByteSource } from "../types.js";
import { RemoteEngine } from "./remote_engine.js";

/** Options of opening a file. */
export interface FileOptions extends SourceOptions {
  /**
   * Whether to decode in a worker, which keeps the thread of the page responsive. Default: true.
   * Without support for workers, as in Node, or if the Content-Security-Policy lacks
   * `worker-src blob:`, the calling thread decodes; see `ReelFile.isInWorker`.
   */
  worker?: boolean;
}

/** The engines of a file: of positions and surface, and of tracks, started on demand. */
export class FileEngines {
  private tracks: Promise<RemoteEngine> | null = null;

  private constructor(
    /** Decodes positions and surfaces. */
    readonly positions: RemoteEngine,
    readonly source: ByteSource,
    private readonly options: FileOptions,
  ) {}

  /** Open a file and one of its segments. Throws as `ReelFile.open`. */
  static async open(
    from: SourceInput | Promise<ByteSource>,
    options: FileOptions,
    segment: number | null,
  ): Promise<{ engines: FileEngines; opened: Results["open"] }> {
    // The module compiles and the worker starts while bytes are being fetched.
    const opening = openSource(from, options);
    const finding = opening.then((file) => findReel(file, options.signal));
    const engine = new RemoteEngine(finding, options.worker ?? true);
    try {
      const [source] = await Promise.all([finding, engine.sendModule(false)]);
      const engines = new FileEngines(engine, source, options);
      return { engines, opened: await engines.openSegment(segment, options.signal) };
    } catch (error) {
      engine.close(error);
      opening.then((source) => source.close()).catch(() => {});
      throw error;
    }
  }

  /** Open a segment, which may be null if there is only one. */
  openSegment(segment: number | null, signal?: AbortSignal): Promise<Results["open"]> {
    return this.positions.call("open", this.parameters(segment), signal);
  }

  /** Start, on the first call, the engine that decodes tracks, and open a segment in it. */
  ofTracks(segment: number | null): Promise<RemoteEngine> {
    this.tracks ??= this.startTracks(segment).catch((error: unknown) => {
      this.tracks = null; // the next call tries again
      throw error;
    });
    return this.tracks;
  }

  /** Release all memory and connections. Pending calls throw an `AbortError`. */
  close(): void {
    const reason = new DOMException("the file was closed", "AbortError");
    this.positions.close(reason);
    this.tracks?.then((engine) => engine.close(reason)).catch(() => {});
    this.source.close();
  }

  private parameters(segment: number | null): Calls["open"] {
    const { size, hasRanges } = this.source;
    return { size, hasRanges, memory: this.options.memory ?? DEFAULT_MEMORY, segment };
  }

  /** Start an engine, and open a segment in it. */
  private async startTracks(segment: number | null): Promise<RemoteEngine> {
    const ranges = await this.positions.call("ranges", {});
    const engine = new RemoteEngine(Promise.resolve(this.source), this.options.worker ?? true);
    try {
      await engine.sendModule(this.positions.isFull);
      await engine.call("open", { ...this.parameters(segment), ranges });
      return engine;
    } catch (error) {
      engine.close(error);
      throw error;
    }
  }
}
