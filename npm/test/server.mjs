// A server of one file that behaves badly in ways that its address says:
// http://127.0.0.1:PORT/file?ranges=no&latencyMs=200. `node test/server.mjs FILE [PORT]` runs it.

import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";

/** What an address can say, and what it means where it does not. */
const BEHAVIOUR = {
  /** Whether there are ranges: "yes", "no", "cut" (no answer where they are asked for). */
  ranges: "yes",
  /** Whether If-Range is heeded, as it must be where there are ranges: "yes", "no". */
  ifRange: "yes",
  /** What tells versions apart: "both" ETag and Last-Modified, "etag", "modified", "none". */
  validators: "both",
  /** Before each answer. */
  latencyMs: 0,
  /** Bytes a second of each answer; 0 = at once. */
  rate: 0,
  /** The connection is cut behind so many bytes of a body; 0 = never. */
  cut: 0,
  /** How many answers are cut. */
  cuts: 1e9,
  /** Nothing more comes behind so many bytes of a body, -1 = never, */
  stall: -1,
  /** in so many answers. */
  stalls: 1e9,
  /** Status of the first answers, */
  status: 200,
  /** as many as these. */
  failures: 1e9,
  /** Whether bodies are compressed: "yes", "ranges" (ranges of what is compressed), "no". */
  gzip: "no",
  /** Whether lengths are left out: "yes", "no". */
  chunked: "no",
  /** After so many answers the file is another, as long as before unless `longer` is set. */
  changeAfter: 1e9,
  longer: 0,
  /** One of LIES or LIES_OF_ALL, */
  lie: "",
  /** told from this answer on, counted from 0. */
  lieFrom: 0,
  /** Other sites may: "all" read all, "plain" read without seeing further headers, "none". */
  cors: "all",
};

/** Each changes a truthful answer, `{ status, range, body, headers }`, that holds a range. */
const LIES = {
  totalLarger: (answer, size) => sayRange(answer, size + 1000),
  totalSmaller: (answer, size) => sayRange(answer, size - 1000),
  noVersion: ({ headers }) => {
    delete headers.etag;
    delete headers["last-modified"];
  },
  noRange: ({ headers }) => delete headers["content-range"],
  oddRange: ({ headers }) => (headers["content-range"] = "bytes 1-0/0, 99999999999999999999"),
  /** Another range than was asked for, and says so. */
  laterRange: (answer, size, file) => sendRange(answer, answer.range.start + 10, size, file),
  earlierRange: (answer, size, file) =>
    sendRange(answer, Math.max(0, answer.range.start - 10), size, file),
  shortRange: (answer, size, file) =>
    sendRange(answer, answer.range.start, size, file, answer.range.start + 5000),
  oldRange: (answer, size, file) => sendRange(answer, 0, size, file, 100),
  /** The body is the whole file, though the header says what was asked for. */
  wholeBody: (answer, size, file) => (answer.body = file),
  lengthLonger: sayLonger,
  lengthShorter: sayShorter,
  /** No ranges any more. */
  whole: (answer, size, file) => {
    Object.assign(answer, { status: 200, body: file });
    delete answer.headers["content-range"];
  },
  refused: (answer) => Object.assign(answer, { status: 416, body: Buffer.from("no") }),
};

/** These change any other answer too. */
const LIES_OF_ALL = {
  bodyShorter: sayLonger,
  bodyLonger: sayShorter,
};

function sayLonger({ headers, body }) {
  headers["content-length"] = body.length + 1000;
}

function sayShorter({ headers, body }) {
  headers["content-length"] = body.length - 1000;
}

function sayRange({ headers, range }, total) {
  headers["content-range"] = `bytes ${range.start}-${range.end - 1}/${total}`;
}

function sendRange(answer, start, size, file, end = answer.range.end) {
  answer.range = { start, end: Math.min(end, size) };
  answer.body = file.subarray(start, answer.range.end);
  sayRange(answer, size);
}

/**
 * Serves `bytes`, and from `changeAfter` on a version in which each byte is another.
 *
 * Returns `address(behaviour)`, one that nobody has asked for before; `requestsOf(address)`, the
 * ranges that were asked for; `bytesSentTo(address)`, the length of all bodies that were sent; and
 * `close()`.
 */
export async function startServer(bytes, port = 0) {
  const original = Buffer.from(bytes);
  const requests = new Map();
  const nSent = new Map();
  let nAddresses = 0;
  const server = createServer((request, response) => {
    const asked = requests.get(request.url) ?? [];
    requests.set(request.url, [...asked, request.headers.range ?? null]);
    const count = (nBytes) => nSent.set(request.url, (nSent.get(request.url) ?? 0) + nBytes);
    serve(original, asked.length, request, response, count).catch((error) => response.destroy(error));
  });
  await new Promise((resolve) => server.listen(port, "127.0.0.1", resolve));
  const origin = `http://127.0.0.1:${server.address().port}`;
  return {
    address: (behaviour = {}) =>
      `${origin}/file?${new URLSearchParams({ ...behaviour, number: nAddresses++ })}`,
    requestsOf: (address) => requests.get(address.slice(origin.length)) ?? [],
    bytesSentTo: (address) => nSent.get(address.slice(origin.length)) ?? 0,
    close: () => {
      server.closeAllConnections();
      server.close();
    },
  };
}

function behaviourOf(url) {
  const behaviour = { ...BEHAVIOUR };
  for (const [name, value] of new URL(url, "http://host").searchParams) {
    if (name === "number") continue;
    if (!(name in BEHAVIOUR)) throw new Error(`no behaviour "${name}"`);
    behaviour[name] = typeof BEHAVIOUR[name] === "number" ? Number(value) : value;
  }
  return behaviour;
}

async function serve(original, nBefore, request, response, count) {
  const how = behaviourOf(request.url);
  const isChanged = nBefore >= how.changeAfter;
  const file = isChanged ? changed(original, how.longer) : original;
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
  const answer = answerFor(file, rangeOf(request, headers, how), headers, how);
  if (how.lie && nBefore >= how.lieFrom) tell(how.lie, answer, file);
  await send(answer, nBefore, response, how, count);
}

function tell(lie, answer, file) {
  const ofAll = LIES_OF_ALL[lie];
  if (!ofAll && !LIES[lie]) throw new Error(`no lie "${lie}"`);
  if (ofAll) ofAll(answer);
  else if (answer.status === 206) LIES[lie](answer, file.length, file);
}

function changed(original, nMore) {
  return Buffer.concat([original.map((value) => value ^ 255), Buffer.alloc(nMore, 7)]);
}

function corsHeaders(cors) {
  if (cors === "none") return {};
  const headers = { "access-control-allow-origin": "*", "access-control-allow-headers": "*" };
  if (cors === "all") headers["access-control-expose-headers"] = "Content-Range, ETag";
  return headers;
}

function rangeOf(request, headers, how) {
  const version = how.ifRange === "yes" ? request.headers["if-range"] : undefined;
  const isOfIt = [undefined, headers.etag, headers["last-modified"]].includes(version);
  return isOfIt ? request.headers.range : undefined;
}

function answerFor(file, asked, headers, how) {
  let body = file;
  if (how.gzip !== "no") {
    body = gzipSync(file);
    headers["content-encoding"] = "gzip";
  }
  const found = /^bytes=(\d+)-(\d+)$/.exec(asked ?? "");
  if (how.ranges === "no" || how.gzip === "yes" || !found) {
    return { status: 200, range: { start: 0, end: body.length }, body, headers };
  }
  const [start, last] = found.slice(1).map(Number);
  if (start >= body.length) {
    headers["content-range"] = `bytes */${body.length}`;
    return { status: 416, range: { start: 0, end: 0 }, body: Buffer.alloc(0), headers };
  }
  const answer = { status: 206, range: { start, end: last + 1 }, body, headers };
  sendRange(answer, start, body.length, body);
  return answer;
}

/** In small steps where the line is slow or ends early. */
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
  // What was written goes out before the connection is cut.
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
