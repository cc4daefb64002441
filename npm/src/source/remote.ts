// Reads a remote file by ranges.

import { InvalidInputError } from "../errors.js";
import type { ByteSource } from "../types.js";
import { Download } from "./download.js";
import { HttpTransport } from "./http_transport.js";
import { clampRange } from "./memory.js";
import { HEAD_BYTES, type DownloadPolicy, type SourceOptions } from "./transport.js";

/** Files up to this size are downloaded entirely, without waiting for further reads. */
const SMALL_FILE_BYTES = 2 * HEAD_BYTES;

/** Limits of the bytes of a download, by default and at most: an endless body must not exhaust memory. */
const [DEFAULT_BUFFER_BYTES, MAX_BUFFER_BYTES] = [2 ** 28, 2 ** 30];

/**
 * Open an address; see `openSource`.
 *
 * @param init - options of all requests
 * @param keptBytes - how many of the bytes read last stay in memory, besides the first ones
 * @throws InvalidInputError for other values.
 */
export async function openRemote(
  from: string | URL,
  init: RequestInit,
  { signal, retries = 3, stallSeconds = 20, memory = DEFAULT_BUFFER_BYTES }: SourceOptions,
  keptBytes = 0,
): Promise<ByteSource> {
  signal?.throwIfAborted();
  if (!(typeof from === "string" || from instanceof URL)) {
    throw new InvalidInputError(
      `a source cannot be opened from ${Object.prototype.toString.call(from)}; pass an address, a Blob,` +
        " an ArrayBuffer or a Uint8Array",
    );
  }
  const server = new HttpTransport(String(from), init);
  const source = new RemoteSource(server, {
    retries,
    stallMs: 1000 * stallSeconds,
    memory: Math.min(memory, MAX_BUFFER_BYTES),
  }, keptBytes);
  signal?.addEventListener("abort", () => source.close(signal.reason), { signal: source.closed });
  try {
    // The first response tells whether the server supports ranges.
    await source.read(0, 1);
  } catch (error) {
    source.close();
    throw error;
  }
  return source;
}

/** A range of bytes and the download that contains it. */
interface RangeRead {
  readonly download: Download;
  readonly start: number;
  readonly end: number;
}

/** A remote file. */
export class RemoteSource implements ByteSource {
  /** The first bytes, or all bytes if the server does not support ranges. */
  private readonly head: Download;
  /** Other downloads: with pending reads, and kept ones, the one read last at the end. */
  private readonly downloads = new Set<Download>();
  private readonly controller = new AbortController();
  /** Aborted once the source is closed. */
  readonly closed = this.controller.signal;

  constructor(
    private readonly transport: HttpTransport,
    private readonly policy: DownloadPolicy,
    private readonly keptBytes = 0,
  ) {
    const ask: HttpTransport["request"] = async (start, end, signal) => {
      const response = await transport.request(start, end, signal);
      const size = transport.size ?? Infinity;
      this.head.end = transport.hasRanges && size > SMALL_FILE_BYTES ? HEAD_BYTES : size;
      return response;
    };
    this.head = new Download({ name: transport.name, request: ask }, 0, HEAD_BYTES, policy);
  }

  get size(): number | null {
    return this.transport.size ?? this.head.size;
  }

  get hasRanges(): boolean {
    return this.transport.hasRanges;
  }

  async read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array> {
    signal?.throwIfAborted();
    this.closed.throwIfAborted();
    const pieces = this.planReads(...clampRange(start, end, this.size));
    try {
      const reads = pieces.map(({ download, start, end }) => download.read(start, end));
      return concatenate(await untilAborted(Promise.all(reads), signal));
    } finally {
      for (const { download } of pieces) this.release(download);
    }
  }

  /** Cancel all reads with the reason: an `AbortError` by default. */
  close(reason: unknown = new DOMException("the source was closed", "AbortError")): void {
    this.controller.abort(reason);
    for (const download of [this.head, ...this.downloads]) download.stop(reason);
  }

  /** Split a read into downloads; bytes that are being received are not requested again. */
  private planReads(start: number, end: number): RangeRead[] {
    const pieces: RangeRead[] = [];
    for (let position = start; position < end; ) {
      const downloads = [this.head, ...this.downloads];
      let download = downloads.find((other) => other.start <= position && position < other.end);
      if (!download) {
        const starts = downloads.map((other) => other.start).filter((other) => other > position);
        download = new Download(this.transport, position, Math.min(end, ...starts), this.policy);
        this.downloads.add(download);
      }
      download.nReaders += 1;
      const pieceEnd = Math.min(end, download.end);
      pieces.push({ download, start: position, end: pieceEnd });
      position = pieceEnd;
    }
    return pieces;
  }

  /**
   * End a read; a download without pending reads is canceled, except for the first bytes and complete
   * ones that are kept.
   */
  private release(download: Download): void {
    download.nReaders -= 1;
    if (download === this.head || !this.downloads.delete(download)) return;
    if (download.nReaders > 0 || download.size !== null) this.downloads.add(download);
    else download.stop(new DOMException("no read needs these bytes", "AbortError"));
    let nKept = 0;
    for (const other of [...this.downloads].reverse()) {
      if (other.nReaders > 0) continue;
      nKept += other.end - other.start;
      if (nKept > this.keptBytes) this.downloads.delete(other);
    }
  }
}

function concatenate(parts: Uint8Array[]): Uint8Array {
  if (parts.length === 1) return parts[0];
  const whole = new Uint8Array(parts.reduce((nBytes, { length }) => nBytes + length, 0));
  let position = 0;
  for (const part of parts) {
    whole.set(part, position);
    position += part.length;
  }
  return whole;
}

/** Wait for a promise; if the signal is aborted first, throw its reason. */
export function untilAborted<T>(work: Promise<T>, signal?: AbortSignal): Promise<T> {
  if (!signal) return work;
  return new Promise((resolve, reject) => {
    const abort = () => reject(signal.reason);
    signal.addEventListener("abort", abort);
    work.then(resolve, reject).finally(() => signal.removeEventListener("abort", abort));
  });
}
