// Bytes that come from a server when they are read.

import type { ByteSource } from "../types.js";
import { Download } from "./download.js";
import { checkedRange } from "./memory.js";
import type { Patience, Server } from "./server.js";

/** What the first question is for. It is kept, for a reader goes over it in small steps. */
const LEAD_BYTES = 65536;
/** Of files that are not larger, the rest follows unasked: all is here as soon as it can be. */
const WHOLE_BYTES = 2 * LEAD_BYTES;

/** Some bytes, and the download that brings them. */
interface Piece {
  readonly download: Download;
  readonly start: number;
  readonly end: number;
}

/** A file of which a server gives what is read. */
export class RemoteSource implements ByteSource {
  /** The first bytes; all where the server has no ranges. */
  private readonly lead: Download;
  /** What else is on its way. */
  private readonly downloads = new Set<Download>();
  private readonly closing = new AbortController();
  /** Aborted once the source is closed. */
  readonly closed = this.closing.signal;

  constructor(
    private readonly server: Server,
    private readonly patience: Patience,
  ) {
    const ask: Server["ask"] = async (start, end, signal) => {
      const answer = await server.ask(start, end, signal);
      const size = server.size ?? Infinity;
      this.lead.end = server.hasRanges && size > WHOLE_BYTES ? LEAD_BYTES : size;
      return answer;
    };
    this.lead = new Download({ name: server.name, ask }, 0, LEAD_BYTES, patience);
  }

  get size(): number | null {
    return this.server.size ?? this.lead.size;
  }

  get hasRanges(): boolean {
    return this.server.hasRanges;
  }

  async read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array> {
    signal?.throwIfAborted();
    this.closed.throwIfAborted();
    const pieces = this.plan(...checkedRange(start, end, this.size));
    try {
      const takes = pieces.map(({ download, start, end }) => download.take(start, end));
      return joined(await untilAborted(Promise.all(takes), signal));
    } finally {
      for (const { download } of pieces) this.release(download);
    }
  }

  /** Ends all reads with the reason, an `AbortError` if none is given. */
  close(reason: unknown = new DOMException("The source was closed", "AbortError")): void {
    this.closing.abort(reason);
    for (const download of [this.lead, ...this.downloads]) download.stop(reason);
  }

  /** Where to take bytes from: what is on its way is not asked for again. */
  private plan(start: number, end: number): Piece[] {
    const pieces: Piece[] = [];
    for (let at = start; at < end; ) {
      const downloads = [this.lead, ...this.downloads];
      let download = downloads.find((other) => other.start <= at && at < other.end);
      if (!download) {
        const starts = downloads.map((other) => other.start).filter((other) => other > at);
        download = new Download(this.server, at, Math.min(end, ...starts), this.patience);
        this.downloads.add(download);
      }
      download.nReaders += 1;
      const pieceEnd = Math.min(end, download.end);
      pieces.push({ download, start: at, end: pieceEnd });
      at = pieceEnd;
    }
    return pieces;
  }

  /** Nothing is kept that nobody waits for, but the first bytes. */
  private release(download: Download): void {
    download.nReaders -= 1;
    if (download.nReaders > 0 || download === this.lead) return;
    download.stop(new DOMException("Nobody waits for these bytes", "AbortError"));
    this.downloads.delete(download);
  }
}

function joined(parts: Uint8Array[]): Uint8Array {
  if (parts.length === 1) return parts[0];
  const whole = new Uint8Array(parts.reduce((nBytes, { length }) => nBytes + length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}

/** What the work gives, unless the signal is aborted before: then its reason is thrown. */
function untilAborted<T>(work: Promise<T>, signal?: AbortSignal): Promise<T> {
  if (!signal) return work;
  return new Promise((resolve, reject) => {
    const abort = () => reject(signal.reason);
    signal.addEventListener("abort", abort);
    work.then(resolve, reject).finally(() => signal.removeEventListener("abort", abort));
  });
}
