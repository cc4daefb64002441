// Local files in Node.

import { SourceError } from "../errors.js";
import type { ByteSource } from "../types.js";
import { BlobSource } from "./memory.js";
import { errorReason } from "./transport.js";

/**
 * Open the file at a path or a `file:` URL; its bytes are read on demand.
 *
 * @throws SourceError if it cannot be read, or is not a regular file.
 */
export async function openLocalFile(url: string, signal?: AbortSignal): Promise<ByteSource> {
  try {
    // Bundlers for browsers would fail to resolve the literal name of a Node module.
    const files = ["node:fs"].join("");
    const { openAsBlob, promises } = await import(/* webpackIgnore: true */ /* @vite-ignore */ files);
    const path = /^file:/i.test(url) ? new URL(url) : url;
    const stat = await promises.stat(path);
    if (!stat.isFile()) throw new Error("it is not a regular file");
    const blob: Blob = await openAsBlob(path);
    signal?.throwIfAborted();
    return new BlobSource(blob, url);
  } catch (error) {
    throw signal?.aborted ? signal.reason : unreadable(url, error);
  }
}

function unreadable(url: string, cause: unknown): SourceError {
  return new SourceError(
    `${url} cannot be read (${errorReason(cause)}); check the path and the permissions of the file`,
    { cause },
  );
}
