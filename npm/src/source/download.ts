// A run of bytes on its way: grows as they come, and asks again for what is missing.

import { SourceError } from "../errors.js";
import { changedError, PassingError, reasonOf } from "./server.js";
import type { Answer, Patience, Server } from "./server.js";

const FIRST_PAUSE_MS = 250;
/** Where so many new bytes came, a connection that is cut does not count as a failure. */
const PROGRESS_BYTES = 4096;
/** What is kept of one download at most: a body without end must not fill the memory. */
const LARGEST_BYTES = 2 ** 30;

/** Consecutive bytes of a file, and how they come. */
export class Download {
  /** How many wait for some of it. */
  nReaders = 0;
  private bytes = new Uint8Array(0);
  private nReceived = 0;
  /** Bytes that are what they seem to be, and may be given away. */
  private nSure = 0;
  private isRunning = false;
  private waiting: ((failure: Error | null) => void)[] = [];
  private readonly stopping = new AbortController();

  /** The bytes `start` to `end - 1`; up to the end of the file where `end` is infinite. */
  constructor(
    private readonly server: Pick<Server, "name" | "ask">,
    readonly start: number,
    public end: number,
    private readonly patience: Patience,
  ) {}

  /** The position behind the last byte, once all are here. */
  get size(): number | null {
    return this.start + this.nSure >= this.end ? this.end : null;
  }

  /** A copy of some of the bytes, once they are here; fewer where the file ends before. */
  async take(start: number, end: number): Promise<Uint8Array> {
    while (this.start + this.nSure < Math.min(end, this.end)) {
      this.stopping.signal.throwIfAborted();
      if (!this.isRunning) void this.run();
      await new Promise<void>((resolve, reject) => {
        this.waiting.push((failure) => (failure ? reject(failure) : resolve()));
      });
    }
    return this.bytes.slice(start - this.start, Math.min(end, this.end) - this.start);
  }

  /** Lets the connection go; who waits gets the reason. */
  stop(reason: unknown): void {
    this.stopping.abort(reason);
  }

  private wake(failure: Error | null = null): void {
    for (const settle of this.waiting.splice(0)) settle(failure);
  }

  private async run(): Promise<void> {
    this.isRunning = true;
    const failure = await this.receiveAll().then(
      () => null,
      (error: Error) => error,
    );
    this.isRunning = false;
    this.wake(failure);
  }

  private async receiveAll(): Promise<void> {
    let [nLeft, pauseMs] = [this.patience.retries, FIRST_PAUSE_MS];
    while (this.start + this.nSure < this.end) {
      const nBefore = this.nSure;
      try {
        await this.receive();
      } catch (error) {
        if (!(error instanceof PassingError)) throw error;
        if (this.nSure - nBefore >= PROGRESS_BYTES) {
          [nLeft, pauseMs] = [this.patience.retries, FIRST_PAUSE_MS];
          continue;
        }
        if (nLeft-- <= 0) throw error;
        await pause(pauseMs, this.stopping.signal);
        pauseMs *= 2;
      }
    }
  }

  /** Takes what one answer gives. */
  private async receive(): Promise<void> {
    const attempt = new AbortController();
    const stop = () => attempt.abort(this.stopping.signal.reason);
    this.stopping.signal.addEventListener("abort", stop, { signal: attempt.signal });
    let timer: ReturnType<typeof setTimeout> | undefined;
    const watch = () => {
      clearTimeout(timer);
      timer = setTimeout(() => attempt.abort(this.stalled()), this.patience.stallMs);
    };
    try {
      this.stopping.signal.throwIfAborted();
      watch();
      const position = this.start + this.nSure;
      const answer = await this.server.ask(position, this.end, attempt.signal);
      await this.fill(answer, watch, attempt.signal);
    } catch (error) {
      throw attempt.signal.aborted ? attempt.signal.reason : error;
    } finally {
      clearTimeout(timer);
      attempt.abort();
      this.nReceived = this.nSure;
    }
  }

  private async fill(answer: Answer, watch: () => void, signal: AbortSignal): Promise<void> {
    const { name } = this.server;
    const reader = answer.body?.getReader();
    signal.addEventListener("abort", () => void reader?.cancel().catch(() => {}));
    let at = answer.start;
    while (reader) {
      const { done, value } = await reader.read().catch((error: unknown) => {
        throw this.cut(at, reasonOf(error), error);
      });
      signal.throwIfAborted();
      if (done) break;
      watch();
      if (at + value.length > (answer.end ?? Infinity)) {
        throw new SourceError(
          `${name}: more bytes came than the server had announced, ${answer.end! - answer.start};` +
            " it must send the file as it is",
        );
      }
      this.append(value, at);
      at += value.length;
      if (!answer.isFramed) continue;
      this.nSure = this.nReceived;
      this.wake();
      if (this.start + this.nSure >= this.end) return;
    }
    if (answer.end === null && at < this.start + this.nReceived) throw changedError(name);
    this.nSure = this.nReceived;
    this.wake();
    if (this.end === Infinity && at >= (answer.end ?? 0)) this.end = at;
    if (this.start + this.nSure < this.end) throw this.cut(at, "it ended early");
  }

  /** Takes bytes from a position on: those before the next one must be as they were. */
  private append(value: Uint8Array, at: number): void {
    const offset = at - this.start;
    const nKnown = Math.min(this.nReceived - offset, value.length);
    for (let i = Math.max(0, -offset); i < nKnown; i++) {
      if (value[i] !== this.bytes[offset + i]) throw changedError(this.server.name);
    }
    const end = Math.min(offset + value.length, this.end - this.start);
    if (end <= this.nReceived) return;
    this.reserve(end);
    this.bytes.set(value.subarray(this.nReceived - offset, end - offset), this.nReceived);
    this.nReceived = end;
  }

  private reserve(nBytes: number): void {
    if (nBytes <= this.bytes.length) return;
    if (nBytes > LARGEST_BYTES) {
      throw new SourceError(
        `${this.server.name}: more than ${LARGEST_BYTES} bytes would have to be kept in memory;` +
          " serve the file with byte ranges",
      );
    }
    const capacity = Math.min(2 * this.bytes.length, this.end - this.start);
    const larger = new Uint8Array(Math.max(nBytes, capacity));
    larger.set(this.bytes.subarray(0, this.nReceived));
    this.bytes = larger;
  }

  private cut(at: number, reason: string, cause?: unknown): PassingError {
    return new PassingError(
      `${this.server.name}: the connection was cut at byte ${at} (${reason});` +
        " check the network, and try again",
      { cause },
    );
  }

  private stalled(): PassingError {
    return new PassingError(
      `${this.server.name}: nothing came for ${this.patience.stallMs / 1000} s behind byte` +
        ` ${this.start + this.nReceived}; check the network, and try again`,
    );
  }
}

function pause(durationMs: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    const end = () => {
      clearTimeout(timer);
      signal.removeEventListener("abort", end);
      if (signal.aborted) reject(signal.reason);
      else resolve();
    };
    const timer = setTimeout(end, durationMs);
    signal.addEventListener("abort", end);
  });
}
