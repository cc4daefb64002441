// Opens the source of the bytes of a file.

import type { ByteSource } from "../types.js";
import { openLocalFile } from "./local_file.js";
import { BlobSource } from "./memory.js";
import { openRemote } from "./remote.js";
import type { SourceInput, SourceOptions } from "./transport.js";

/**
 * Open a source whose bytes are fetched when they are read.
 *
 * Reads become range requests. If the server does not support ranges, or sends neither ETag nor
 * Last-Modified, the whole file is downloaded once and kept in memory; received bytes can be read
 * while the rest is being downloaded. Lost connections are resumed where they ended.
 *
 * @param from - An address, a blob, or bytes, which are copied; or a source, which is returned.
 * @throws InvalidInputError if `from` cannot be opened; SourceError if the server does not send the
 *   file.
 */
export async function openSource(
  from: SourceInput | Promise<ByteSource>,
  options: SourceOptions = {},
): Promise<ByteSource> {
  const { signal, headers, credentials, cache = "no-store" } = options;
  if (from instanceof Promise) return from;
  signal?.throwIfAborted();
  if (from instanceof Blob) return new BlobSource(from);
  if (from instanceof ArrayBuffer || from instanceof Uint8Array) {
    return new BlobSource(new Blob([from as BlobPart])); // a copy
  }
  if (isNode() && (/^file:/i.test(String(from)) || isPath(from))) return openLocalFile(String(from), signal);
  return openRemote(from, { headers, credentials, cache }, options);
}

/** Whether this is Node, whose `fetch` does not support `file:` URLs. */
function isNode(): boolean {
  return !!(globalThis as { process?: { versions?: { node?: string } } }).process?.versions?.node;
}

/** Whether this is an address without scheme or page: a path; one letter is a drive of Windows. */
function isPath(from: SourceInput): boolean {
  return typeof from === "string" && !globalThis.location && !/^\w\w+:/.test(from);
}
