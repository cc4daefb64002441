// What answers of a server are taken for: whose bytes they hold, and of which version of a file.

import assert from "node:assert/strict";
import { afterEach, describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const { outputFiles } = await build({
  stdin: {
    contents: 'export * from "./source/address"; export { PassingError } from "./source/server";',
    resolveDir: fileURLToPath(new URL("../src", import.meta.url)),
  },
  bundle: true,
  format: "esm",
  write: false,
});
const script = Buffer.from(outputFiles[0].contents).toString("base64");
const { Address, PassingError, partOf } = await import(`data:text/javascript;base64,${script}`);

/** Bytes that requests repeat where versions are not told. */
const OVERLAP = 64;
const NAME = "http://example.invalid/walk.reel";
const { signal } = new AbortController();
const realFetch = globalThis.fetch;
afterEach(() => (globalThis.fetch = realFetch));

/** An address with prepared answers, in order, and the ranges it asks for. */
function scripted(...answers) {
  const asked = [];
  globalThis.fetch = async (request) => {
    asked.push(request.headers.get("range"));
    const answer = answers.shift();
    if (answer instanceof Error) throw answer;
    return answer;
  };
  return [new Address(NAME, {}), asked];
}

function whole(headers = {}, status = 200) {
  return new Response("0123456789", { status, headers });
}

/** Ten bytes of a file of 100 from a position on. */
function part(start, headers = { etag: '"1"' }, size = 100) {
  const place = `bytes ${start}-${start + 9}/${size}`;
  return whole({ "content-range": place, "content-length": "10", ...headers }, 206);
}

describe("an answer", () => {
  for (const [headers, end] of [
    [{ "content-length": "10" }, 10],
    [{ "content-length": "10", "content-encoding": "identity" }, 10],
    [{ "content-length": "10", "content-encoding": "gzip" }, null],
    [{}, null],
  ]) {
    test(`of a whole file with ${JSON.stringify(headers)} ends at ${end}`, () => {
      const { start, end: found, size, isFramed } = partOf(whole(headers));
      assert.deepEqual([start, found, size, isFramed], [0, end, end, true]);
    });
  }

  for (const [range, start, end] of [
    ["bytes 0-9/10", 0, 10],
    ["bytes 5-14/15", 5, 15],
    ["bytes 0-9/9007199254740991", 0, 10],
  ]) {
    test(`with ${range} holds these bytes`, () => {
      const found = partOf(whole({ "content-range": range, "content-length": "10" }, 206));
      assert.deepEqual([found.start, found.end, found.isFramed], [start, end, true]);
      assert.equal(found.size, Number(range.split("/")[1]));
    });
  }

  test("may hold a single byte", () => {
    const { start, end } = partOf(whole({ "content-range": "bytes 3-3/10" }, 206));
    assert.deepEqual([start, end], [3, 4]);
  });

  test("of a range without a length may be longer", () => {
    assert.equal(partOf(whole({ "content-range": "bytes 0-9/10" }, 206)).isFramed, false);
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
    test(`of a range with ${JSON.stringify(headers)} holds nobody knows what`, () => {
      assert.equal(partOf(whole(headers, 206)), null);
    });
  }
});

describe("the first question", () => {
  test("finds ranges where a server names only a time", async () => {
    const [address] = scripted(part(0, { "last-modified": "x" }));
    await address.ask(0, 10, signal);
    assert.equal(address.hasRanges, true);
  });

  test("finds ranges where a server names a version", async () => {
    const [address, asked] = scripted(part(0), part(50));
    await address.ask(0, 10, signal);
    assert.deepEqual([address.hasRanges, address.size], [true, 100]);
    assert.equal((await address.ask(50, 60, signal)).start, 50);
    assert.deepEqual(asked, ["bytes=0-9", "bytes=50-59"]);
  });

  test("finds the rest of a file where a server names no version", async () => {
    const rest = (start) => whole({ "content-range": `bytes ${start}-99/100` }, 206);
    const [address, asked] = scripted(part(0, {}), rest(90 - OVERLAP), rest(0));
    await address.ask(0, 10, signal);
    assert.equal(address.hasRanges, false);
    assert.equal((await address.ask(90, 100, signal)).start, 90 - OVERLAP);
    await address.ask(OVERLAP - 1, 100, signal);
    assert.deepEqual(asked, ["bytes=0-9", `bytes=${90 - OVERLAP}-99`, "bytes=0-99"]);
  });

  for (const [what, first] of [
    ["a whole file", []],
    ["status 416", [whole({}, 416)]],
    ["other bytes", [part(5)]],
    ["bytes of nobody knows where", [whole({}, 206)]],
  ]) {
    test(`finds no ranges where it brings ${what}`, async () => {
      const [address, asked] = scripted(...first, whole(), whole());
      assert.equal((await address.ask(0, 10, signal)).start, 0);
      assert.equal(address.hasRanges, false);
      await address.ask(20, 30, signal);
      const expected = first.length ? ["bytes=0-9", null, null] : ["bytes=0-9", null];
      assert.deepEqual(asked, expected);
    });
  }

  test("is without a range the second time where it got no answer", async () => {
    const [address, asked] = scripted(new TypeError("fetch failed"), whole());
    await assert.rejects(address.ask(0, 10, signal), PassingError);
    await address.ask(0, 10, signal);
    assert.deepEqual(asked, ["bytes=0-9", null]);
  });
});

describe("a later answer", () => {
  for (const [what, first, second, isSame] of [
    ["the same ETag", { etag: "a", "last-modified": "x" }, { etag: "a", "last-modified": "y" }, true],
    ["another ETag", { etag: "a", "last-modified": "x" }, { etag: "b", "last-modified": "x" }, false],
    ["the same time", { etag: "a", "last-modified": "x" }, { "last-modified": "x" }, true],
    ["another time", { "last-modified": "x" }, { etag: "b", "last-modified": "y" }, false],
    ["no version", { etag: "a" }, {}, false],
    ["another sort of version", { etag: "a" }, { "last-modified": "x" }, false],
  ]) {
    test(`with ${what} is ${isSame ? "of the same" : "of another"} file`, async () => {
      const [address] = scripted(part(0, first), part(50, second));
      await address.ask(0, 10, signal);
      const answer = address.ask(50, 60, signal);
      if (isSame) assert.equal((await answer).start, 50);
      else await assert.rejects(answer, /has changed since it was opened/);
    });
  }

  test("of a longer file is of another file", async () => {
    const [address] = scripted(part(0), part(50, { etag: '"1"' }, 101));
    await address.ask(0, 10, signal);
    await assert.rejects(address.ask(50, 60, signal), /has changed/);
  });

  test("with status 416 is of another file", async () => {
    const [address] = scripted(part(0), whole({}, 416));
    await address.ask(0, 10, signal);
    await assert.rejects(address.ask(50, 60, signal), /has changed/);
  });

  for (const [start, fits] of [[50, true], [51, false], [41, true], [40, false]]) {
    test(`with ten bytes from ${start} on ${fits ? "fits" : "does not fit"} byte 50`, async () => {
      const [address] = scripted(part(0), part(start));
      await address.ask(0, 10, signal);
      const answer = address.ask(50, 60, signal);
      if (fits) assert.equal((await answer).end, start + 10);
      else await assert.rejects(answer, /asked for bytes=50-59 and answered HTTP 206.*does not fit/);
    });
  }
});

describe("a refusal", () => {
  for (const [status, passes, words] of [
    [500, true, /has trouble/],
    [503, true, /has trouble/],
    [429, true, /has trouble/],
    [408, true, /has trouble/],
    [404, false, /no such file/],
    [410, false, /no such file/],
    [401, false, /credentials/],
    [403, false, /credentials/],
    [400, false, /open the address in a browser/],
    [499, false, /open the address in a browser/],
  ]) {
    test(`with status ${status} ${passes ? "may pass" : "stays"}`, async () => {
      const [address] = scripted(whole({}, status));
      await assert.rejects(address.ask(0, 10, signal), (error) => {
        assert.match(error.message, words);
        return error instanceof PassingError === passes;
      });
    });
  }
});
