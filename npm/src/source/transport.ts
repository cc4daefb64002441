// The interface between downloads and the protocol that delivers bytes.

import { SourceError } from "../errors.js";

/**
 * A source: an address (in Node also a path or a `file:` URL), a response of `fetch`, a blob, or bytes.
 */
export type SourceInput = string | URL | Response | ArrayBuffer | Uint8Array | Blob;

/** Options of reading a source. */
export interface SourceOptions {
  /** Cancels opening and all later reads with its reason: an `AbortError` by default. */
  signal?: AbortSignal;
  /** Headers of each request. For other origins, some headers make browsers send a preflight. */
  headers?: HeadersInit;
  /** As in `fetch`; "include" sends cookies to other origins too. */
  credentials?: RequestCredentials;
  /**
   * As in `fetch`. Default: "no-store", since Chromium returns ranges of a changed file with the ETag
   * of its cached version, unless the server supports If-Range. "default" is for servers that do.
   */
  cache?: RequestCache;
  /** Number of retries that receive nothing new before a read fails. Default: 3. */
  retries?: number;
  /** Seconds without received bytes after which a connection counts as lost. Default: 20. */
  stallSeconds?: number;
}

/** The response to a request for bytes. */
export interface ResponseBody {
  /** Position of the first byte of the body; at most the requested position. */
  readonly start: number;
  /** Position after the last byte; null if only the end of the body determines it. */
  readonly end: number | null;
  /**
   * Whether the headers limit the length of the body. If not, bytes are trusted only once the body has
   * ended where it should.
   */
  readonly isFramed: boolean;
  readonly body: ReadableStream<Uint8Array> | null;
}

/** Requests bytes of a file. */
export interface Transport {
  /** Address, for error messages. */
  readonly name: string;
  /** Size of the file in bytes; null while unknown. */
  readonly size: number | null;
  readonly hasRanges: boolean;
  /**
   * Request the bytes `start` to `end - 1`.
   *
   * @throws TransientError if a retry may succeed, otherwise SourceError.
   */
  request(start: number, end: number, signal: AbortSignal): Promise<ResponseBody>;
}

/** Bytes of the first request. They are kept, since opening a file reads them in small steps. */
export const HEAD_BYTES = 65536;

/** A failure that may be temporary: of the network, or of an overloaded server. */
export class TransientError extends SourceError {}

/** When to retry. */
export interface RetryPolicy {
  /** Number of retries that receive nothing new before a read fails. */
  readonly retries: number;
  /** Milliseconds without received bytes after which a connection counts as lost. */
  readonly stallMs: number;
}

/** Return the message of a network error; Node stores it in the cause. */
export function errorReason(error: unknown): string {
  const { message, cause } = error as { message?: string; cause?: { message?: string } };
  return cause?.message || message || String(error);
}

export function fileChangedError(name: string): SourceError {
  return new SourceError(`${name} has changed since it was opened; open it again`);
}
