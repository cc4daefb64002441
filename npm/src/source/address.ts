// A file at an address, asked for by ranges where its server has them; what the server says about
// it is not believed, but compared.

import { InvalidInputError, SourceError } from "../errors.js";
import { changedError, PassingError, reasonOf } from "./server.js";
import type { Answer, Server } from "./server.js";

/** What tells one version of a file from another. */
interface Version {
  readonly etag: string | null;
  readonly modified: string | null;
  readonly size: number | null;
}

/** A body and whose bytes it is said to hold. */
interface Part extends Answer {
  /** Of the whole file. */
  readonly size: number | null;
}

/**
 * Without ETag and Last-Modified, the request for the rest of a file repeats this many bytes, which
 * are compared with those already received. Streams are entropy-coded: two versions that differ
 * around this place differ in these bytes.
 */
const OVERLAP_BYTES = 64;

/** A file that a server has. */
export class Address implements Server {
  /** Which ranges requests have: any; only the rest behind what was received; or none. */
  private ranges: "any" | "rest" | "none" = "any";
  private version: Version | null = null;

  /**
   * Sends nothing yet: the first question finds out what the server can do. It has to be for bytes
   * from 0 on, and brings the whole file where there are no ranges.
   */
  constructor(
    readonly name: string,
    private readonly init: RequestInit,
  ) {}

  get size(): number | null {
    return this.version?.size ?? null;
  }

  get hasRanges(): boolean {
    return this.ranges === "any";
  }

  async ask(start: number, end: number, signal: AbortSignal): Promise<Answer> {
    const first = this.ranges === "rest" ? Math.max(0, start - OVERLAP_BYTES) : start;
    const range = this.ranges === "none" ? null : `bytes=${first}-${end - 1}`;
    const response = await this.send(range, signal);
    const part = partOf(response);
    const { status, headers } = response;
    const [etag, modified] = [headers.get("etag"), headers.get("last-modified")];
    if (!this.version && range) {
      // A range is of use only if it can be seen which bytes it holds; those that are anywhere in
      // the file only if it can be seen of which version they are.
      const isUseful = status === 206 && part?.start === 0;
      if (isUseful && !(etag || modified)) this.ranges = "rest";
      else if (status === 416 || (response.ok && !isUseful)) this.ranges = "none";
      if (status === 416 || (status === 206 && !isUseful)) {
        response.body?.cancel().catch(() => {});
        return this.ask(start, end, signal);
      }
    }
    if (!response.ok) throw this.refusal(status);
    if (part) this.check({ etag, modified, size: part.size });
    if (!part || part.start > first || (status === 206 && part.end! <= start)) {
      const said = (header: string) => `${header} "${headers.get(header) ?? ""}"`;
      throw new SourceError(
        `${this.name}: the server was asked for ${range ?? "the file"} and answered HTTP` +
          ` ${status} with ${said("Content-Range")} and ${said("Content-Length")}, which does not` +
          " fit; it must send byte ranges as they are asked for, or none",
      );
    }
    return { ...part, end: part.end ?? this.size };
  }

  private async send(range: string | null, signal: AbortSignal): Promise<Response> {
    let request: Request;
    try {
      const headers = new Headers(this.init.headers);
      if (range) headers.set("range", range);
      request = new Request(this.name, { ...this.init, headers, signal });
    } catch (error) {
      throw new InvalidInputError(
        `${this.name} cannot be asked for (${reasonOf(error)}); give an http, https or (in Node) file URL`,
      );
    }
    try {
      return await fetch(request);
    } catch (error) {
      // Browsers do not say why: perhaps it was the range, which a server must allow to other sites
      // and must not compress.
      if (!this.version && !signal.aborted) this.ranges = this.hasRanges ? "none" : "any";
      throw new PassingError(
        `${this.name} cannot be reached (${reasonOf(error)}); check the address and the network,` +
          " and, if it is of another site than the page, that it sends Access-Control-Allow-Origin",
        { cause: error },
      );
    }
  }

  private check(version: Version): void {
    const first = (this.version ??= version);
    const { etag, modified, size } = version;
    const isSame =
      first.etag && etag
        ? first.etag === etag
        : first.modified && modified
          ? first.modified === modified
          : !this.hasRanges; // Bytes are compared.
    const isAsLong = first.size === null || size === null || first.size === size;
    if (!isSame || !isAsLong) throw changedError(this.name);
  }

  private refusal(status: number): SourceError {
    if (status === 416 && this.ranges !== "none") return changedError(this.name);
    const what = `${this.name}: HTTP ${status}`;
    if (status >= 500 || status === 429 || status === 408) {
      return new PassingError(`${what}; the server has trouble, try again later`);
    }
    if (status === 404 || status === 410) {
      return new SourceError(`${what}; there is no such file, check the address`);
    }
    if (status === 401 || status === 403) {
      return new SourceError(
        `${what}; the server does not give the file to this page: check who may read it, or pass` +
          " credentials or headers",
      );
    }
    return new SourceError(`${what}; open the address in a browser to see what is wrong with it`);
  }
}

/** What a response claims to hold, or null if that cannot be made out. */
export function partOf(response: Response): Part | null {
  const { body, headers, status, type } = response;
  const isEncoded = !/^(identity)?$/i.test(headers.get("content-encoding") ?? "");
  const length = headers.has("content-length") ? Number(headers.get("content-length")) : null;
  if (status !== 206) {
    // The length is that of the body as it was sent: of no use if that was compressed, which
    // responses of other sites do not tell.
    const size = isEncoded || type === "cors" ? null : length;
    return { start: 0, end: size, isFramed: true, size, body };
  }
  const found = /^bytes (\d+)-(\d+)\/(\d+)$/.exec(headers.get("content-range") ?? "");
  if (!found || isEncoded) return null;
  const [start, last, size] = found.slice(1).map(Number);
  if (last < start || last >= size || !Number.isSafeInteger(size)) return null;
  const end = last + 1;
  if (length !== null && length !== end - start) return null;
  return { start, end, isFramed: length !== null, size, body };
}
