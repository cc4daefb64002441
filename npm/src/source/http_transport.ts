// Requests a file over HTTP, by ranges if the server supports them. Headers of responses are
// checked for consistency, since servers and caches get them wrong.

import { InvalidInputError, SourceError } from "../errors.js";
import { fileChangedError, TransientError, errorReason } from "./transport.js";

/** Identifies a version of a file. */
interface Version {
  readonly etag: string | null;
  readonly modified: string | null;
  readonly size: number | null;
}

/** The body of a response, and the bytes of the file that its headers declare. */
export interface FilePart {
  /** Position of the first byte of the body; at most the requested position. */
  readonly start: number;
  /** Position after the last byte; null if only the end of the body determines it. */
  readonly end: number | null;
  /**
   * Whether the headers limit the length of the body. If not, bytes are trusted only once the body has
   * ended where it should.
   */
  readonly isFramed: boolean;
  /** Size of the whole file; null if unknown. */
  readonly size: number | null;
  readonly body: ReadableStream<Uint8Array> | null;
}

/**
 * Without ETag and Last-Modified, the request for the rest of a file repeats this many bytes, which
 * are compared with those received before. Files are entropy-coded, so that two versions that differ
 * around this position also differ in these bytes.
 */
const OVERLAP_BYTES = 64;

/** Requests a file by URL. */
export class HttpTransport {
  /** Ranges that requests use: any; only the rest behind the bytes received so far; or none. */
  private ranges: "any" | "rest" | "none" = "any";
  private version: Version | null = null;

  /**
   * Sends no request. The first one determines whether the server supports ranges; it must start
   * at byte 0, and returns the whole file if there is no support.
   */
  constructor(
    readonly name: string,
    private readonly init: RequestInit,
  ) {}

  /** Size of the file in bytes; null while unknown. */
  get size(): number | null {
    return this.version?.size ?? null;
  }

  get hasRanges(): boolean {
    return this.ranges === "any";
  }

  /**
   * Request the bytes `start` to `end - 1`.
   *
   * @throws TransientError if a retry may succeed, otherwise SourceError.
   */
  async request(start: number, end: number, signal: AbortSignal): Promise<FilePart> {
    const first = this.ranges === "rest" ? Math.max(0, start - OVERLAP_BYTES) : start;
    const range = this.ranges === "none" ? null : `bytes=${first}-${end - 1}`;
    const response = await this.send(range, signal);
    const part = parseResponse(response);
    const { status, headers } = response;
    const [etag, modified] = [headers.get("etag"), headers.get("last-modified")];
    if (!this.version && range) {
      // A range is usable if its position is known. Ranges at any position are usable only if the
      // version of the file is known too.
      const isUseful = status === 206 && part?.start === 0;
      if (isUseful && !(etag || modified)) this.ranges = "rest";
      else if (status === 416 || (response.ok && !isUseful)) this.ranges = "none";
      if (status === 416 || (status === 206 && !isUseful)) {
        response.body?.cancel().catch(() => {});
        return this.request(start, end, signal);
      }
    }
    if (!response.ok) throw this.statusError(status);
    if (part) this.checkVersion({ etag, modified, size: part.size });
    const isRange = status === 206;
    const isOther = part && (isRange ? part.start !== first || part.end! <= start : part.start > first);
    // A longer range is read up to the requested byte, if its length is certain.
    const isTooLong = part && isRange && !part.isFramed && part.end! > end;
    if (!part || isOther || isTooLong) {
      const quote = (header: string) => `${header} "${headers.get(header) ?? ""}"`;
      throw new SourceError(
        `${this.name}: the request for ${range ?? "the file"} returned HTTP ${status} with` +
          ` ${quote("Content-Range")} and ${quote("Content-Length")}, which do not match it;` +
          " the server must send the requested byte ranges, or none",
      );
    }
    return { ...part, end: part.end ?? this.size };
  }

  private async send(range: string | null, signal: AbortSignal): Promise<Response> {
    let request: Request;
    try {
      const headers = new Headers(this.init.headers);
      // With a range, `fetch` itself asks for unencoded bytes; browsers ignore this header.
      if (range) headers.set("range", range);
      else headers.set("accept-encoding", "identity");
      request = new Request(this.name, { ...this.init, headers, signal });
    } catch (error) {
      throw new InvalidInputError(
        `${this.name} cannot be requested (${errorReason(error)}); pass an http, https or (in Node) file URL`,
      );
    }
    try {
      return await fetch(request);
    } catch (error) {
      // Browsers hide the reason. It may be the Range header, which a server must allow for other
      // origins: try again without it.
      if (!this.version && !signal.aborted) this.ranges = this.hasRanges ? "none" : "any";
      throw new TransientError(
        `${this.name} cannot be reached (${errorReason(error)}); check the address, the network, and, for` +
          " another origin, that the server sends Access-Control-Allow-Origin",
        { cause: error },
      );
    }
  }

  private checkVersion(version: Version): void {
    const first = (this.version ??= version);
    const { etag, modified, size } = version;
    const isSame =
      first.etag && etag
        ? first.etag === etag
        : first.modified && modified
          ? first.modified === modified
          : !this.hasRanges; // then `Download` compares bytes
    const isAsLong = first.size === null || size === null || first.size === size;
    if (!isSame || !isAsLong) throw fileChangedError(this.name);
  }

  private statusError(status: number): SourceError {
    if (status === 416 && this.ranges !== "none") return fileChangedError(this.name);
    const prefix = `${this.name}: HTTP ${status}`;
    if (status >= 500 || status === 429 || status === 408) {
      return new TransientError(`${prefix}; try again later`);
    }
    if (status === 404 || status === 410) {
      return new SourceError(`${prefix}; there is no such file, check the address`);
    }
    if (status === 401 || status === 403) {
      return new SourceError(
        `${prefix}; access is denied: check the permissions, or pass credentials or headers`,
      );
    }
    return new SourceError(`${prefix}; open the address in a browser`);
  }
}

/** Return the range of bytes that a response declares, or null if its headers are inconsistent. */
export function parseResponse(response: Response): FilePart | null {
  const { body, headers, status, type } = response;
  const isEncoded = !/^(identity)?$/i.test(headers.get("content-encoding") ?? "");
  const length = headers.has("content-length") ? Number(headers.get("content-length")) : null;
  if (status !== 206) {
    // Content-Length is the compressed size if the body was compressed, and for other origins
    // browsers hide whether it was.
    const size = isEncoded || type === "cors" ? null : length;
    return { start: 0, end: size, isFramed: true, size, body };
  }
  const match = /^bytes (\d+)-(\d+)\/(\d+)$/.exec(headers.get("content-range") ?? "");
  if (!match || isEncoded) return null;
  const [start, last, size] = match.slice(1).map(Number);
  if (last < start || last >= size || !Number.isSafeInteger(size)) return null;
  const end = last + 1;
  if (length !== null && length !== end - start) return null;
  return { start, end, isFramed: length !== null, size, body };
}
