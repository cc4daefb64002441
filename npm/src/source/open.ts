// Opens the source of the bytes of a file.

import { SourceError } from "../errors.js";
import type { ByteSource } from "../types.js";
import { BlobSource, clampRange, MemorySource } from "./memory.js";
import { errorReason, fileChangedError, type FirstRequest, HEAD_BYTES } from "./transport.js";

/**
 * A source: an address (in Node also a path or a `file:` URL), a response of `fetch`, a blob, or bytes.
 */
export type SourceInput = string | URL | Response | ArrayBuffer | Uint8Array | Blob;

/** Options of `openSource`. */
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

/**
 * Open a source whose bytes are fetched when they are read.
 *
 * Reads become range requests. If the server does not support ranges, or sends neither ETag nor
 * Last-Modified, the whole file is downloaded once and kept in memory; received bytes can be read
 * while the rest is being downloaded. Lost connections are resumed where they ended.
 *
 * @param from - An address, a response whose body is unread, a blob, or bytes. Bytes in memory are
 *   neither changed nor detached, and must not change while the source is open.
 * @throws InvalidInputError if `from` cannot be opened; SourceError if the server does not send the
 *   file.
 */
export async function openSource(
  from: SourceInput,
  options: SourceOptions = {},
): Promise<ByteSource> {
  const { signal, headers, credentials, cache = "no-store" } = options;
  signal?.throwIfAborted();
  if (from instanceof Blob) return new BlobSource(from);
  if (from instanceof ArrayBuffer) return new MemorySource(new Uint8Array(from));
  if (from instanceof Uint8Array) return new MemorySource(from);
  if (isNode() && (/^file:/i.test(String(from)) || isPath(from))) {
    const { openLocalFile } = await import("./local_file.js");
    const shared = { SourceError, clampRange, fileChangedError, errorReason };
    return openLocalFile(String(from), shared, signal);
  }
  const init = { headers, credentials, cache };
  const first = from instanceof Response ? null : sendFirstRequest(from, init);
  try {
    // A separate script, since pages that pass bytes do not need it.
    const { openRemote } = await import("./remote.js");
    return await openRemote(from, init, options, first);
  } catch (error) {
    first?.abort.abort(error);
    throw error;
  }
}

/** Request the first bytes while the script is loaded that reads addresses. */
function sendFirstRequest(address: string | URL, init: RequestInit): FirstRequest {
  const abort = new AbortController();
  const range = `bytes=0-${HEAD_BYTES - 1}`;
  const send = async (): Promise<Response> => {
    const headers = new Headers(init.headers);
    headers.set("range", range);
    return fetch(address, { ...init, headers, signal: abort.signal });
  };
  const response = send();
  response.catch(() => {}); // reported when the response is used
  return { range, response, abort };
}

/** Whether this is Node, whose `fetch` does not support `file:` URLs. */
function isNode(): boolean {
  return !!(globalThis as { process?: { versions?: { node?: string } } }).process?.versions?.node;
}

/** Whether this is an address without scheme or page: a path; one letter is a drive of Windows. */
function isPath(from: SourceInput): boolean {
  return typeof from === "string" && !globalThis.location && !/^\w\w+:/.test(from);
}
