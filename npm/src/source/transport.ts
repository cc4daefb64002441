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
  /** Seconds with fewer than 4096 received bytes after which a connection counts as lost. Default: 20. */
  stallSeconds?: number;
  /**
   * Limit of the memory that decoding may use, in bytes, and, up to 1 GiB, of that for a file whose
   * server does not support ranges. A small malicious file could exhaust it: files that need more
   * throw a `MemoryLimitError`. Default: 2 GiB; 256 MiB for a file without ranges.
   */
  memory?: number;
}

/** Default memory limit in bytes: 2 GiB. */
export const DEFAULT_MEMORY = 2 ** 31;

/** Bytes of the first request. They are kept, since opening a file reads them in small steps. */
export const HEAD_BYTES = 65536;

/** A failure that may be temporary: of the network, or of an overloaded server. */
export class TransientError extends SourceError {}

/** When to retry, and how much to keep. */
export interface DownloadPolicy {
  /** Number of retries that receive nothing new before a read fails. */
  readonly retries: number;
  /** Milliseconds with hardly any received bytes after which a connection counts as lost. */
  readonly stallMs: number;
  /** Largest number of bytes that a download may keep. */
  readonly memory: number;
}

/** Return the message of a network error; Node stores it in the cause. */
export function errorReason(error: unknown): string {
  const { message, cause } = error as { message?: string; cause?: { message?: string } };
  return cause?.message || message || String(error);
}

export function fileChangedError(name: string): SourceError {
  return new SourceError(`${name} has changed since it was opened; open it again`);
}
