// Local files in Node.

import { SourceError } from "../errors.js";
import type { ByteSource } from "../types.js";
import { clampRange } from "./memory.js";
import { errorReason, fileChangedError } from "./transport.js";

/** The part of Node's `FileHandle` that is used. */
interface Handle {
  stat(): Promise<Stat>;
  read(
    into: Uint8Array,
    offset: number,
    length: number,
    position: number,
  ): Promise<{ bytesRead: number }>;
  close(): Promise<void>;
}

interface Stat {
  readonly size: number;
  readonly mtimeMs: number;
  isFile(): boolean;
}

/** A regular file, read by ranges. */
class LocalFile implements ByteSource {
  readonly hasRanges = true;
  private closed: unknown = null;

  constructor(
    private readonly url: string,
    private readonly handle: Handle,
    private readonly stat: Stat,
  ) {}

  get size(): number {
    return this.stat.size;
  }

  async read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array> {
    signal?.throwIfAborted();
    if (this.closed) throw this.closed;
    const [first, stop] = clampRange(start, end, this.size);
    const bytes = new Uint8Array(stop - first);
    let nRead = 0;
    try {
      // A read may return fewer bytes than requested, and returns none at the end of the file.
      for (let n = -1; n !== 0 && nRead < bytes.length; nRead += n) {
        n = (await this.handle.read(bytes, nRead, bytes.length - nRead, first + nRead)).bytesRead;
      }
      const { size, mtimeMs } = await this.handle.stat();
      if (size !== this.size || mtimeMs !== this.stat.mtimeMs || nRead < bytes.length) {
        throw fileChangedError(this.url);
      }
    } catch (error) {
      throw this.closed ?? withPath(error, this.url);
    }
    signal?.throwIfAborted();
    return bytes;
  }

  close(reason: unknown = new DOMException("the source was closed", "AbortError")): void {
    if (this.closed) return;
    this.closed = reason;
    this.handle.close().catch(() => {}); // nothing was written, so that nothing is lost
  }
}

/** Return an error that names the file. */
function withPath(error: unknown, url: string): unknown {
  if (error instanceof SourceError) return error;
  return new SourceError(
    `${url} cannot be read (${errorReason(error)}); check the path and the permissions of the file`,
    { cause: error },
  );
}

/**
 * Open the file of a path or a `file:` URL.
 *
 * @param signal - Closes the file.
 * @throws SourceError if it cannot be read, or is not a regular file.
 */
export async function openLocalFile(url: string, signal?: AbortSignal): Promise<ByteSource> {
  let handle: Handle | undefined;
  try {
    // A computed name keeps bundlers for browsers from resolving a module of Node.
    const files = ["node:fs", "promises"].join("/");
    const { open } = await import(/* webpackIgnore: true */ /* @vite-ignore */ files);
    const opened: Handle = (handle = await open(/^file:/i.test(url) ? new URL(url) : url));
    const stat = await opened.stat();
    if (!stat.isFile()) throw new Error("it is not a regular file");
    signal?.throwIfAborted();
    const source = new LocalFile(url, opened, stat);
    signal?.addEventListener("abort", () => source.close(signal.reason), { once: true });
    return source;
  } catch (error) {
    await handle?.close();
    throw signal?.aborted ? signal.reason : withPath(error, url);
  }
}
