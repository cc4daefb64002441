// Downloads a range of bytes, and retries after failures with the bytes that are missing.

import { SourceError } from "../errors.js";
import { fileChangedError, HEAD_BYTES, TransientError, errorReason } from "./transport.js";
import type { FilePart, HttpTransport } from "./http_transport.js";
import type { DownloadPolicy } from "./transport.js";

const FIRST_PAUSE_MS = 250;
/** A lost connection does not count as a failure if it delivered at least this many bytes. */
const PROGRESS_BYTES = 4096;
/** Received bytes are kept in pages, so that they are never copied to grow. */
const PAGE_BYTES = HEAD_BYTES;

/** Consecutive bytes of a file that are being received. */
export class Download {
  /** Number of pending reads. */
  nReaders = 0;
  private readonly pages: Uint8Array[] = [];
  private nReceived = 0;
  /** Received bytes that are known to be right and may be returned. */
  private nVerified = 0;
  private isReceiving = false;
  private waiting: ((failure: Error | null) => void)[] = [];
  private readonly controller = new AbortController();

  /** Bytes `start` to `end - 1`; an infinite `end` means the end of the file. */
  constructor(
    private readonly transport: Pick<HttpTransport, "name" | "request">,
    readonly start: number,
    public end: number,
    private readonly policy: DownloadPolicy,
  ) {}

  /** The position after the last byte, once all are received; else null. */
  get size(): number | null {
    return this.start + this.nVerified >= this.end ? this.end : null;
  }

  /** Wait for bytes and return a copy, which is shorter if the file ends before. */
  async read(start: number, end: number): Promise<Uint8Array> {
    while (this.start + this.nVerified < Math.min(end, this.end)) {
      this.controller.signal.throwIfAborted();
      if (!this.isReceiving) void this.startReceiving();
      await new Promise<void>((resolve, reject) => {
        this.waiting.push((failure) => (failure ? reject(failure) : resolve()));
      });
    }
    return this.copy(start - this.start, Math.min(end, this.end) - this.start);
  }

  /** Copy received bytes, which are counted from the start of the download. */
  private copy(start: number, end: number): Uint8Array {
    const bytes = new Uint8Array(Math.max(0, end - start));
    for (let position = start; position < end; ) {
      const offset = position % PAGE_BYTES;
      const page = this.pages[(position - offset) / PAGE_BYTES];
      bytes.set(page.subarray(offset, Math.min(PAGE_BYTES, offset + end - position)), position - start);
      position += PAGE_BYTES - offset;
    }
    return bytes;
  }

  /** Close the connection; pending reads throw the reason. */
  stop(reason: unknown): void {
    this.controller.abort(reason);
  }

  private notify(failure: Error | null = null): void {
    for (const settle of this.waiting.splice(0)) settle(failure);
  }

  private async startReceiving(): Promise<void> {
    this.isReceiving = true;
    const failure = await this.receiveAll().then(
      () => null,
      (error: Error) => error,
    );
    this.isReceiving = false;
    this.notify(failure);
  }

  private async receiveAll(): Promise<void> {
    let [nLeft, pauseMs] = [this.policy.retries, FIRST_PAUSE_MS];
    while (this.start + this.nVerified < this.end) {
      const nBefore = this.nVerified;
      try {
        await this.receive();
      } catch (error) {
        if (!(error instanceof TransientError)) throw error;
        if (this.nVerified - nBefore >= PROGRESS_BYTES) {
          [nLeft, pauseMs] = [this.policy.retries, FIRST_PAUSE_MS];
          continue;
        }
        if (nLeft-- <= 0) throw error;
        await pause(pauseMs, this.controller.signal);
        pauseMs *= 2;
      }
    }
  }

  /** Receive the body of one response. */
  private async receive(): Promise<void> {
    const attempt = new AbortController();
    const stop = () => attempt.abort(this.controller.signal.reason);
    this.controller.signal.addEventListener("abort", stop, { signal: attempt.signal });
    let timer: ReturnType<typeof setTimeout> | undefined;
    let nLeft = 0;
    const resetTimer = (nBytes: number) => {
      if ((nLeft -= nBytes) > 0) return;
      nLeft = PROGRESS_BYTES;
      clearTimeout(timer);
      timer = setTimeout(() => attempt.abort(this.stallError()), this.policy.stallMs);
    };
    try {
      this.controller.signal.throwIfAborted();
      resetTimer(0);
      const position = this.start + this.nVerified;
      const response = await this.transport.request(position, this.end, attempt.signal);
      await this.receiveBody(response, resetTimer, attempt.signal);
    } catch (error) {
      throw attempt.signal.aborted ? attempt.signal.reason : error;
    } finally {
      clearTimeout(timer);
      attempt.abort();
      this.nReceived = this.nVerified;
    }
  }

  private async receiveBody(response: FilePart, resetTimer: (nBytes: number) => void, signal: AbortSignal): Promise<void> {
    const { name } = this.transport;
    const reader = response.body?.getReader();
    signal.addEventListener("abort", () => void reader?.cancel().catch(() => {}));
    let position = response.start;
    while (reader) {
      const { done, value } = await reader.read().catch((error: unknown) => {
        throw this.connectionLost(position, errorReason(error), error);
      });
      signal.throwIfAborted();
      if (done) break;
      resetTimer(value.length);
      if (position + value.length > (response.end ?? Infinity)) {
        throw new SourceError(
          `${name}: the server sent more bytes than it announced, ${response.end! - response.start};` +
            " it must send the file unchanged",
        );
      }
      this.append(value, position);
      position += value.length;
      if (!response.isFramed) continue;
      this.nVerified = this.nReceived;
      this.notify();
      if (this.start + this.nVerified >= this.end) return;
    }
    if (response.end === null && position < this.start + this.nReceived) throw fileChangedError(name);
    this.nVerified = this.nReceived;
    this.notify();
    if (this.end === Infinity && position >= (response.end ?? 0)) this.end = position;
    if (this.start + this.nVerified < this.end) throw this.connectionLost(position, "the body ended early");
  }

  /** Append received bytes; those that overlap earlier ones must be equal. */
  private append(value: Uint8Array, position: number): void {
    const offset = position - this.start;
    const first = Math.max(0, offset);
    const known = this.copy(first, Math.min(this.nReceived, offset + value.length));
    if (known.some((byte, i) => byte !== value[first - offset + i])) {
      throw fileChangedError(this.transport.name);
    }
    const end = Math.min(offset + value.length, this.end - this.start);
    const { memory } = this.policy;
    // An announced size is refused before more than the first bytes are received.
    if ((Number.isFinite(this.end) ? this.end - this.start : end) > memory) {
      throw new SourceError(
        `${this.transport.name}: more than ${memory} bytes would have to be buffered;` +
          " serve the file with byte ranges, or allow more with `memory`",
      );
    }
    while (this.nReceived < end) {
      const inPage = this.nReceived % PAGE_BYTES;
      const page = (this.pages[(this.nReceived - inPage) / PAGE_BYTES] ??= new Uint8Array(
        Math.min(PAGE_BYTES, this.end - this.start - this.nReceived),
      ));
      const nBytes = Math.min(PAGE_BYTES - inPage, end - this.nReceived);
      const from = this.nReceived - offset;
      page.set(value.subarray(from, from + nBytes), inPage);
      this.nReceived += nBytes;
    }
  }

  private connectionLost(position: number, reason: string, cause?: unknown): TransientError {
    return new TransientError(
      `${this.transport.name}: the connection was lost at byte ${position} (${reason});` +
        " check the network, and try again",
      { cause },
    );
  }

  private stallError(): TransientError {
    return new TransientError(
      `${this.transport.name}: received fewer than ${PROGRESS_BYTES} bytes in ${this.policy.stallMs / 1000} s` +
        ` up to byte ${this.start + this.nReceived}; check the network, and try again`,
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
