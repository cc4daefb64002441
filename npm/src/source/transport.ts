// Sources, options of reading them, and failures.

import { SourceError } from "../errors.js";

/**
 * A source: an address (in Node also a path or a `file:` URL), a blob, or bytes.
 */
export type SourceInput = string | URL | ArrayBuffer | Uint8Array | Blob;

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
