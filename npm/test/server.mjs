// A server of one file that misbehaves as the query of its address requests:
// http://127.0.0.1:PORT/file?ranges=no&latencyMs=200. `node test/server.mjs FILE [PORT]` runs it.

import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";

/** Parameters of an address and their defaults. */
const BEHAVIOR = {
  /** Support of ranges: "yes", "no", "cut" (range requests get no response). */
  ranges: "yes",
  /** Whether If-Range is supported: "yes", "no". */
  ifRange: "yes",
  /** Validators: "both" ETag and Last-Modified, "etag", "modified", "none". */
  validators: "both",
  /** Delay of each response. */
  latencyMs: 0,
  /** Bytes per second of each response; 0: unlimited. */
  rate: 0,
  /** Close the connection after this many bytes of a body; 0: never. */
  cut: 0,
  /** Number of responses that are cut. */
  cuts: 1e9,
  /** Stop sending after this many bytes of a body; -1: never. */
  stall: -1,
  /** Number of responses that stall. */
  stalls: 1e9,
  /** Status of the first responses. */
  status: 200,
  /** Number of responses with this status. */
  failures: 1e9,
  /** Compression: "yes", "ranges" (ranges of the compressed body), "no". */
  gzip: "no",
  /** Whether Content-Length is omitted: "yes", "no". */
  chunked: "no",
  /** Number of responses after which the file changes, by `longer` bytes in size. */
  changeAfter: 1e9,
  longer: 0,
  /** A wrong header or body: one of RANGE_FAULTS or BODY_FAULTS. */
  fault: "",
  /** Index of the first response with this fault. */
  faultFrom: 0,
  /** CORS: "all" headers are exposed, "plain" allows reads without exposed headers, "none". */
  cors: "all",
};

/** Each modifies a correct range response `{ status, range, body, headers }`. */
const RANGE_FAULTS = {
  totalLarger: (reply, size) => setRangeHeader(reply, size + 1000),
  totalSmaller: (reply, size) => setRangeHeader(reply, size - 1000),
  noVersion: ({ headers }) => {
    delete headers.etag;
    delete headers["last-modified"];
  },
  noRange: ({ headers }) => delete headers["content-range"],
  oddRange: ({ headers }) => (headers["content-range"] = "bytes 1-0/0, 99999999999999999999"),
  /** Another range than requested, with a matching header. */
  laterRange: (reply, size, file) => setRange(reply, reply.range.start + 10, size, file),
  earlierRange: (reply, size, file) =>
    setRange(reply, Math.max(0, reply.range.start - 10), size, file),
  shortRange: (reply, size, file) =>
    setRange(reply, reply.range.start, size, file, reply.range.start + 5000),
  longRange: (reply, size, file) =>
    setRange(reply, reply.range.start, size, file, reply.range.end + 50_000),
  oldRange: (reply, size, file) => setRange(reply, 0, size, file, 100),
  /** The whole file as body, with the header of the requested range. */
  wholeBody: (reply, size, file) => (reply.body = file),
  lengthLonger: announceLonger,
  lengthShorter: announceShorter,
  /** Ranges are no longer supported. */
  whole: (reply, size, file) => {
    Object.assign(reply, { status: 200, body: file });
    delete reply.headers["content-range"];
  },
  refused: (reply) => Object.assign(reply, { status: 416, body: Buffer.from("no") }),
};

/** These modify other responses too. */
const BODY_FAULTS = {
  bodyShorter: announceLonger,
  bodyLonger: announceShorter,
};

function announceLonger({ headers, body }) {
  headers["content-length"] = body.length + 1000;
}

function announceShorter({ headers, body }) {
  headers["content-length"] = body.length - 1000;
}

function setRangeHeader({ headers, range }, total) {
  headers["content-range"] = `bytes ${range.start}-${range.end - 1}/${total}`;
}

function setRange(reply, start, size, file, end = reply.range.end) {
  reply.range = { start, end: Math.min(end, size) };
  reply.body = file.subarray(start, reply.range.end);
  setRangeHeader(reply, size);
}

/**
 * Serve `bytes`, and after `changeAfter` responses a version in which all bytes differ.
 *
 * Returns `address(behavior)`, a new address; `requestsOf(address)`, the requested ranges;
 * `bytesSentTo(address)`, the length of all bodies that were sent; and `close()`.
 */
export async function startServer(bytes, port = 0) {
  const original = Buffer.from(bytes);
  const requests = new Map();
  const nSent = new Map();
  let nAddresses = 0;
  const server = createServer((request, response) => {
    const previous = requests.get(request.url) ?? [];
    requests.set(request.url, [...previous, request.headers.range ?? null]);
    const count = (nBytes) => nSent.set(request.url, (nSent.get(request.url) ?? 0) + nBytes);
    serve(original, previous.length, request, response, count).catch((error) => response.destroy(error));
  });
  await new Promise((resolve) => server.listen(port, "127.0.0.1", resolve));
  const origin = `http://127.0.0.1:${server.address().port}`;
  return {
    address: (behavior = {}) =>
      `${origin}/file?${new URLSearchParams({ ...behavior, number: nAddresses++ })}`,
    requestsOf: (address) => requests.get(address.slice(origin.length)) ?? [],
    bytesSentTo: (address) => nSent.get(address.slice(origin.length)) ?? 0,
    close: () => {
      server.closeAllConnections();
      server.close();
    },
  };
}

function behaviorOf(url) {
  const behavior = { ...BEHAVIOR };
  for (const [name, value] of new URL(url, "http://host").searchParams) {
    if (name === "number") continue;
    if (!(name in BEHAVIOR)) throw new Error(`unknown parameter "${name}"`);
    behavior[name] = typeof BEHAVIOR[name] === "number" ? Number(value) : value;
  }
  return behavior;
}

async function serve(original, nBefore, request, response, count) {
  const how = behaviorOf(request.url);
  const isChanged = nBefore >= how.changeAfter;
  const file = isChanged ? changedFile(original, how.longer) : original;
  const headers = { "content-type": "application/octet-stream", ...corsHeaders(how.cors) };
  if (request.method === "OPTIONS") return void response.writeHead(204, headers).end();
  await sleep(how.latencyMs);
  if (how.ranges === "cut" && request.headers.range) return void response.destroy();
  if (how.status !== 200 && nBefore < how.failures) {
    return void response.writeHead(how.status, headers).end("trouble");
  }
  if (/both|etag/.test(how.validators)) headers.etag = isChanged ? '"two"' : '"one"';
  if (/both|modified/.test(how.validators)) {
    headers["last-modified"] = new Date(isChanged ? 2e12 : 1e12).toUTCString();
  }
  const reply = createResponse(file, rangeOf(request, headers, how), headers, how);
  if (how.fault && nBefore >= how.faultFrom) applyFault(how.fault, reply, file);
  await send(reply, nBefore, response, how, count);
}

function applyFault(fault, reply, file) {
  const bodyFault = BODY_FAULTS[fault];
  if (!bodyFault && !RANGE_FAULTS[fault]) throw new Error(`unknown fault "${fault}"`);
  if (bodyFault) bodyFault(reply);
  else if (reply.status === 206) RANGE_FAULTS[fault](reply, file.length, file);
}

function changedFile(original, nExtraBytes) {
  return Buffer.concat([original.map((value) => value ^ 255), Buffer.alloc(nExtraBytes, 7)]);
}

function corsHeaders(cors) {
  if (cors === "none") return {};
  const headers = { "access-control-allow-origin": "*", "access-control-allow-headers": "*" };
  if (cors === "all") headers["access-control-expose-headers"] = "Content-Range, ETag";
  return headers;
}

function rangeOf(request, headers, how) {
  const version = how.ifRange === "yes" ? request.headers["if-range"] : undefined;
  const isCurrent = [undefined, headers.etag, headers["last-modified"]].includes(version);
  return isCurrent ? request.headers.range : undefined;
}

function createResponse(file, requested, headers, how) {
  let body = file;
  if (how.gzip !== "no") {
    body = gzipSync(file);
    headers["content-encoding"] = "gzip";
  }
  const match = /^bytes=(\d+)-(\d+)$/.exec(requested ?? "");
  if (how.ranges === "no" || how.gzip === "yes" || !match) {
    return { status: 200, range: { start: 0, end: body.length }, body, headers };
  }
  const [start, last] = match.slice(1).map(Number);
  if (start >= body.length) {
    headers["content-range"] = `bytes */${body.length}`;
    return { status: 416, range: { start: 0, end: 0 }, body: Buffer.alloc(0), headers };
  }
  const reply = { status: 206, range: { start, end: last + 1 }, body, headers };
  setRange(reply, start, body.length, body);
  return reply;
}

/** Send a body, in small steps if the connection is slow or ends early. */
async function send({ status, headers, body }, nBefore, response, how, count) {
  const isCut = how.cut > 0 && nBefore < how.cuts && how.cut < body.length;
  const isStalled = how.stall >= 0 && nBefore < how.stalls && how.stall < body.length;
  const length = headers["content-length"] ?? body.length;
  if (how.chunked === "no") headers["content-length"] = length;
  response.strictContentLength = false;
  response.writeHead(status, headers);
  response.flushHeaders();
  const end = isCut ? how.cut : isStalled ? how.stall : body.length;
  const step = how.rate > 0 ? Math.ceil(how.rate / 20) : end || 1;
  for (let at = 0; at < end && !response.destroyed; at += step) {
    const part = body.subarray(at, Math.min(end, at + step));
    response.write(part);
    count(part.length);
    if (how.rate > 0) await sleep(50);
  }
  if (isStalled) return;
  // Flush what was written before the connection is closed.
  if (isCut || length > body.length) {
    await sleep(20);
    response.destroy();
  } else {
    response.end();
  }
}

function sleep(durationMs) {
  return durationMs > 0 ? new Promise((resolve) => setTimeout(resolve, durationMs)) : undefined;
}

if (import.meta.url === pathToFileURL(process.argv[1] ?? "").href) {
  const [file, port] = process.argv.slice(2);
  const server = await startServer(await readFile(file), Number(port ?? 0));
  console.log(server.address());
}
