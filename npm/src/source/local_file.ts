// A file of this machine, in Node. Pages never load this script.

import type { SourceError } from "../errors.js";
import type { ByteSource } from "../types.js";

/** The part of a `FileHandle` of Node that is used. */
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

/** Parts of the main script, passed in so that this script has no copies of them. */
export interface Shared {
  readonly SourceError: typeof SourceError;
  checkedRange(start: number, end: number, size: number): [number, number];
  changedError(name: string): SourceError;
  reasonOf(error: unknown): string;
}

/** A regular file, read by ranges. */
class LocalFile implements ByteSource {
  readonly hasRanges = true;
  private closed: unknown = null;

  constructor(
    private readonly url: string,
    private readonly handle: Handle,
    private readonly stat: Stat,
    private readonly shared: Shared,
  ) {}

  get size(): number {
    return this.stat.size;
  }

  async read(start: number, end: number, signal?: AbortSignal): Promise<Uint8Array> {
    signal?.throwIfAborted();
    if (this.closed) throw this.closed;
    const [first, behind] = this.shared.checkedRange(start, end, this.size);
    const bytes = new Uint8Array(behind - first);
    let nRead = 0;
    try {
      // A call may give fewer bytes than it could, and gives none at the end of the file.
      for (let n = -1; n !== 0 && nRead < bytes.length; nRead += n) {
        n = (await this.handle.read(bytes, nRead, bytes.length - nRead, first + nRead)).bytesRead;
      }
      const { size, mtimeMs } = await this.handle.stat();
      if (size !== this.size || mtimeMs !== this.stat.mtimeMs || nRead < bytes.length) {
        throw this.shared.changedError(this.url);
      }
    } catch (error) {
      throw this.closed ?? namedError(error, this.url, this.shared);
    }
    signal?.throwIfAborted();
    return bytes;
  }

  close(reason: unknown = new DOMException("The source was closed", "AbortError")): void {
    if (this.closed) return;
    this.closed = reason;
    this.handle.close().catch(() => {}); // nothing was written that could be lost
  }
}

/** An error that names the file. */
function namedError(error: unknown, url: string, { SourceError, reasonOf }: Shared): unknown {
  if (error instanceof SourceError) return error;
  return new SourceError(
    `${url} cannot be read (${reasonOf(error)}); check the path, and whether you may read the file`,
    { cause: error },
  );
}

/**
 * The file that a `file:` URL names.
 *
 * @param signal - Closes the file, with its reason.
 * @throws SourceError where it cannot be read, or is not a regular file.
 */
export async function openLocalFile(
  url: string,
  shared: Shared,
  signal?: AbortSignal,
): Promise<ByteSource> {
  let handle: Handle | undefined;
  try {
    // Bundlers for pages look for modules whose names they find, and fail for those of Node.
    const files = ["node:fs", "promises"].join("/");
    const { open } = await import(/* webpackIgnore: true */ /* @vite-ignore */ files);
    const opened: Handle = (handle = await open(new URL(url)));
    const stat = await opened.stat();
    if (!stat.isFile()) throw new Error("it is not a regular file");
    signal?.throwIfAborted();
    const source = new LocalFile(url, opened, stat, shared);
    signal?.addEventListener("abort", () => source.close(signal.reason), { once: true });
    return source;
  } catch (error) {
    await handle?.close();
    throw signal?.aborted ? signal.reason : namedError(error, url, shared);
  }
}
