// Opens whatever bytes come from.

import { InvalidInputError, SourceError } from "../errors.js";
import type { ByteSource } from "../types.js";
import { Address, partOf } from "./address.js";
import { BlobSource, checkedRange, MemorySource } from "./memory.js";
import { RemoteSource } from "./remote.js";
import { changedError, reasonOf, type Server } from "./server.js";

/**
 * What can be opened: an address (in Node also a `file:` URL), a response of `fetch`, or the bytes
 * themselves.
 */
export type SourceInput = string | URL | Response | ArrayBuffer | Uint8Array | Blob;

export interface SourceOptions {
  /** Ends the opening and, later, all reads, with its reason: an `AbortError` by default. */
  signal?: AbortSignal;
  /** Sent with each request. Some make browsers ask the server first whether it allows them. */
  headers?: HeadersInit;
  /** As of `fetch`; "include" sends cookies to other sites too. */
  credentials?: RequestCredentials;
  /**
   * As of `fetch`; "no-store" by default: Chromium gives ranges of a changed file with the ETag of
   * that in its cache, unless the server heeds If-Range. "default" is for servers that do.
   */
  cache?: RequestCache;
  /** How often a request is repeated where nothing new comes; 3 by default. */
  retries?: number;
  /** How long to wait for a server that sends nothing, in seconds; 20 by default. */
  stallSeconds?: number;
}

/**
 * Bytes of a file that are had when they are read.
 *
 * Requests have ranges. If the server has none, or sends neither ETag nor Last-Modified, the file
 * comes as a whole, once, and is kept in memory; what is here can be read while the rest is on its way. Connections that are cut are taken up
 * where they ended.
 *
 * @param from - An address, a response whose body nobody has read, or bytes. Those in memory are
 *   never changed or detached, and must not change as long as the source is open.
 * @throws InvalidInputError for what cannot be opened; SourceError where the server does not give
 *   the file: the message says what to do.
 */
export async function openSource(
  from: SourceInput,
  {
    signal,
    headers,
    credentials,
    cache = "no-store",
    retries = 3,
    stallSeconds = 20,
  }: SourceOptions = {},
): Promise<ByteSource> {
  signal?.throwIfAborted();
  if (from instanceof Blob) return new BlobSource(from);
  if (from instanceof ArrayBuffer) return new MemorySource(new Uint8Array(from));
  if (from instanceof Uint8Array) return new MemorySource(from);
  if (/^file:/i.test(String(from)) && isNode()) {
    const { openLocalFile } = await import("./local_file.js");
    const shared = { SourceError, checkedRange, changedError, reasonOf };
    return openLocalFile(String(from), shared, signal);
  }
  const server = serverOf(from, { headers, credentials, cache });
  const nRetries = from instanceof Response ? 0 : retries;
  const source = new RemoteSource(server, { retries: nRetries, stallMs: 1000 * stallSeconds });
  signal?.addEventListener("abort", () => source.close(signal.reason), { signal: source.closed });
  try {
    // Once a byte is here, it is known whether there are ranges.
    await source.read(0, 1);
  } catch (error) {
    source.close();
    throw error;
  }
  return source;
}

/** Whether files can be read: `fetch` of Node knows no `file:` URLs. */
function isNode(): boolean {
  return !!(globalThis as { process?: { versions?: { node?: string } } }).process?.versions?.node;
}

function serverOf(from: string | URL | Response, init: RequestInit): Server {
  if (typeof from === "string" || from instanceof URL) return new Address(String(from), init);
  if (from instanceof Response) return givenBody(from);
  throw new InvalidInputError(
    `a source cannot be opened from ${Object.prototype.toString.call(from)}; give an address, a` +
      " Response, a Blob, an ArrayBuffer or a Uint8Array",
  );
}

/** A response of the user's, which can be read once. */
function givenBody(response: Response): Server {
  const name = response.url || "the response";
  const part = partOf(response);
  if (response.bodyUsed || response.body?.locked) {
    throw new InvalidInputError(`${name} has been read already; give one that nobody reads`);
  }
  if (!response.ok || !part || part.start > 0 || part.end !== part.size) {
    throw new SourceError(`${name} is not of a whole file (HTTP ${response.status})`);
  }
  let isGiven = false;
  const ask = async () => {
    if (isGiven) {
      throw new SourceError(
        `${name} cannot be asked for what is missing; open the address instead`,
      );
    }
    isGiven = true;
    return part;
  };
  return { name, size: part.size, hasRanges: false, ask };
}
