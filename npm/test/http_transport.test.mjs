// How responses are interpreted: which bytes they contain, and of which version of a file.

import assert from "node:assert/strict";
import { afterEach, describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const { outputFiles } = await build({
  stdin: {
    contents: 'export * from "./source/http_transport"; export { TransientError } from "./source/transport";',
    resolveDir: fileURLToPath(new URL("../src", import.meta.url)),
  },
  bundle: true,
  format: "esm",
  write: false,
});
const script = Buffer.from(outputFiles[0].contents).toString("base64");
const { HttpTransport, TransientError, parseResponse } = await import(`data:text/javascript;base64,${script}`);

/** Bytes that requests repeat if the server sends no version. */
const OVERLAP = 64;
const NAME = "http://example.invalid/walk.reel";
const { signal } = new AbortController();
const realFetch = globalThis.fetch;
afterEach(() => (globalThis.fetch = realFetch));

/** A transport with prepared responses, in order, and the ranges that it requests. */
function scripted(...responses) {
  const ranges = [];
  globalThis.fetch = async (request) => {
    ranges.push(request.headers.get("range"));
    const response = responses.shift();
    if (response instanceof Error) throw response;
    return response;
  };
  return [new HttpTransport(NAME, {}), ranges];
}

function whole(headers = {}, status = 200) {
  return new Response("0123456789", { status, headers });
}

/** A response with ten bytes, starting with byte `start`, of a file of 100. */
function part(start, headers = { etag: '"1"' }, size = 100) {
  const range = `bytes ${start}-${start + 9}/${size}`;
  return whole({ "content-range": range, "content-length": "10", ...headers }, 206);
}

describe("a response", () => {
  for (const [headers, end] of [
    [{ "content-length": "10" }, 10],
    [{ "content-length": "10", "content-encoding": "identity" }, 10],
    [{ "content-length": "10", "content-encoding": "gzip" }, null],
    [{}, null],
  ]) {
    test(`of a whole file with ${JSON.stringify(headers)} ends at ${end}`, () => {
      const parsed = parseResponse(whole(headers));
      assert.deepEqual([parsed.start, parsed.end, parsed.size, parsed.isFramed], [0, end, end, true]);
    });
  }

  for (const [range, start, end] of [
    ["bytes 0-9/10", 0, 10],
    ["bytes 5-14/15", 5, 15],
    ["bytes 0-9/9007199254740991", 0, 10],
  ]) {
    test(`with ${range} contains these bytes`, () => {
      const parsed = parseResponse(whole({ "content-range": range, "content-length": "10" }, 206));
      assert.deepEqual([parsed.start, parsed.end, parsed.isFramed], [start, end, true]);
      assert.equal(parsed.size, Number(range.split("/")[1]));
    });
  }

  test("may contain a single byte", () => {
    const { start, end } = parseResponse(whole({ "content-range": "bytes 3-3/10" }, 206));
    assert.deepEqual([start, end], [3, 4]);
  });

  test("with a range but without Content-Length is not framed", () => {
    assert.equal(parseResponse(whole({ "content-range": "bytes 0-9/10" }, 206)).isFramed, false);
  });

  for (const headers of [
    {},
    { "content-range": "bytes 0-9/*" },
    { "content-range": "bytes 9-8/10" },
    { "content-range": "bytes 0-10/10" },
    { "content-range": "bytes 0-9/9007199254740992" },
    { "content-range": "bytes 0-9/10, 5" },
    { "content-range": "bytes 0-9/10", "content-length": "9" },
    { "content-range": "bytes 0-9/10", "content-encoding": "gzip" },
  ]) {
    test(`with an inconsistent range is rejected: ${JSON.stringify(headers)}`, () => {
      assert.equal(parseResponse(whole(headers, 206)), null);
    });
  }
});

describe("the first request", () => {
  test("detects ranges if the server sends only Last-Modified", async () => {
    const [transport] = scripted(part(0, { "last-modified": "x" }));
    await transport.request(0, 10, signal);
    assert.equal(transport.hasRanges, true);
  });

  test("detects ranges if the server sends an ETag", async () => {
    const [transport, ranges] = scripted(part(0), part(50));
    await transport.request(0, 10, signal);
    assert.deepEqual([transport.hasRanges, transport.size], [true, 100]);
    assert.equal((await transport.request(50, 60, signal)).start, 50);
    assert.deepEqual(ranges, ["bytes=0-9", "bytes=50-59"]);
  });

  test("allows only ranges up to the end if the server sends no version", async () => {
    const rest = (start) => whole({ "content-range": `bytes ${start}-99/100` }, 206);
    const [transport, ranges] = scripted(part(0, {}), rest(90 - OVERLAP), rest(0));
    await transport.request(0, 10, signal);
    assert.equal(transport.hasRanges, false);
    assert.equal((await transport.request(90, 100, signal)).start, 90 - OVERLAP);
    await transport.request(OVERLAP - 1, 100, signal);
    assert.deepEqual(ranges, ["bytes=0-9", `bytes=${90 - OVERLAP}-99`, "bytes=0-99"]);
  });

  for (const [what, first] of [
    ["a whole file", []],
    ["status 416", [whole({}, 416)]],
    ["a range at another position", [part(5)]],
    ["a range without a position", [whole({}, 206)]],
  ]) {
    test(`detects missing range support from ${what}`, async () => {
      const [transport, ranges] = scripted(...first, whole(), whole());
      assert.equal((await transport.request(0, 10, signal)).start, 0);
      assert.equal(transport.hasRanges, false);
      await transport.request(20, 30, signal);
      const expected = first.length ? ["bytes=0-9", null, null] : ["bytes=0-9", null];
      assert.deepEqual(ranges, expected);
    });
  }

  test("is repeated without a range if it gets no response", async () => {
    const [transport, ranges] = scripted(new TypeError("fetch failed"), whole());
    await assert.rejects(transport.request(0, 10, signal), TransientError);
    await transport.request(0, 10, signal);
    assert.deepEqual(ranges, ["bytes=0-9", null]);
  });
});

describe("a later response", () => {
  for (const [what, first, second, isSame] of [
    ["the same ETag", { etag: "a", "last-modified": "x" }, { etag: "a", "last-modified": "y" }, true],
    ["another ETag", { etag: "a", "last-modified": "x" }, { etag: "b", "last-modified": "x" }, false],
    ["the same time", { etag: "a", "last-modified": "x" }, { "last-modified": "x" }, true],
    ["another time", { "last-modified": "x" }, { etag: "b", "last-modified": "y" }, false],
    ["no version", { etag: "a" }, {}, false],
    ["another kind of version", { etag: "a" }, { "last-modified": "x" }, false],
  ]) {
    test(`with ${what} is accepted as ${isSame ? "the same" : "another"} file`, async () => {
      const [transport] = scripted(part(0, first), part(50, second));
      await transport.request(0, 10, signal);
      const response = transport.request(50, 60, signal);
      if (isSame) assert.equal((await response).start, 50);
      else await assert.rejects(response, /has changed since it was opened/);
    });
  }

  test("with another size is from another file", async () => {
    const [transport] = scripted(part(0), part(50, { etag: '"1"' }, 101));
    await transport.request(0, 10, signal);
    await assert.rejects(transport.request(50, 60, signal), /has changed/);
  });

  test("with status 416 is from another file", async () => {
    const [transport] = scripted(part(0), whole({}, 416));
    await transport.request(0, 10, signal);
    await assert.rejects(transport.request(50, 60, signal), /has changed/);
  });

  for (const [start, fits] of [[50, true], [51, false], [41, false], [40, false]]) {
    test(`with ten bytes from ${start} is ${fits ? "accepted" : "refused"} when byte 50 is the first one requested`, async () => {
      const [transport] = scripted(part(0), part(start));
      await transport.request(0, 10, signal);
      const response = transport.request(50, 60, signal);
      if (fits) assert.equal((await response).end, start + 10);
      else await assert.rejects(response, /request for bytes=50-59 returned HTTP 206.*do not match it/);
    });
  }
});

describe("an error", () => {
  for (const [status, isTransient, message] of [
    [500, true, /try again later/],
    [503, true, /try again later/],
    [429, true, /try again later/],
    [408, true, /try again later/],
    [404, false, /no such file/],
    [410, false, /no such file/],
    [401, false, /credentials/],
    [403, false, /credentials/],
    [400, false, /open the address in a browser/],
    [499, false, /open the address in a browser/],
  ]) {
    test(`with status ${status} is ${isTransient ? "transient" : "permanent"}`, async () => {
      const [transport] = scripted(whole({}, status));
      await assert.rejects(transport.request(0, 10, signal), (error) => {
        assert.match(error.message, message);
        return error instanceof TransientError === isTransient;
      });
    });
  }
});
