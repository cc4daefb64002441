// Reads from misbehaving servers return the right bytes or a descriptive error.

import assert from "node:assert/strict";
import { createServer } from "node:http";
import { Readable } from "node:stream";
import { after, before, describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";
import { startServer } from "./server.mjs";

const SIZE = 200_000;
const HEAD = 65536;
/** Bytes that are requested twice and compared without ETag and Last-Modified. */
const OVERLAP = 64;
const TIMEOUT_MS = 30_000;

/** Pseudo-random bytes: no two windows of a few bytes are equal. */
function randomBytes(size) {
  const bytes = new Uint8Array(size);
  let state = 12345;
  for (let i = 0; i < size; i++) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    bytes[i] = state >>> 24;
  }
  return bytes;
}

const FILE = randomBytes(SIZE);
let server;
let openRemote, openShared, openSource, RemoteSource, errors;

before(async () => {
  const folder = fileURLToPath(new URL("../src", import.meta.url));
  const { outputFiles } = await build({
    stdin: {
      contents:
        'export { openSource } from "./source/open"; export { openShared } from "./source/shared";' +
        'export { openRemote, RemoteSource } from "./source/remote"; export * as errors from "./errors";',
      resolveDir: folder,
    },
    bundle: true,
    format: "esm",
    write: false,
  });
  const script = Buffer.from(outputFiles[0].contents).toString("base64");
  ({ openRemote, openShared, openSource, RemoteSource, errors } = await import(`data:text/javascript;base64,${script}`));
  server = await startServer(FILE);
});
after(() => server.close());

/** Wait for a promise, with a timeout whose error names what was waited for. */
async function withTimeout(what, promise) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`waited ${TIMEOUT_MS} ms for ${what}`)), TIMEOUT_MS);
  });
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}

/** A server with scripted responses, each a function of the request and the response. */
async function scripted(...responses) {
  const ranges = [];
  const other = createServer((request, response) => {
    ranges.push(request.headers.range);
    responses[ranges.length - 1](request, response);
  });
  await new Promise((resolve) => other.listen(0, "127.0.0.1", resolve));
  after(() => other.close().closeAllConnections());
  return { address: `http://127.0.0.1:${other.address().port}/`, ranges };
}

/** A response with the header of a range and any bytes. */
function rangeResponse(start, end, bytes, headers = {}) {
  return (request, response) => {
    const range = { "content-range": `bytes ${start}-${end - 1}/${SIZE}`, etag: '"one"' };
    response.writeHead(206, { ...range, ...headers }).write(bytes);
    return response;
  };
}

/** Yield a number of megabytes of zeros. */
function* zeros(nMegabytes) {
  for (let i = 0; i < nMegabytes; i++) yield new Uint8Array(1e6);
}

const headResponse = (...all) => rangeResponse(0, HEAD, FILE.subarray(0, HEAD))(...all).end();

/** Close the connection after what was written has been sent. */
function cut(response) {
  setTimeout(() => response.destroy(), 20);
}

function openWithTimeout(address, options) {
  return withTimeout(`the opening of ${address}`, openSource(address, options));
}

async function assertReads(source, start, end, signal) {
  const bytes = await withTimeout(`bytes ${start} to ${end}`, source.read(start, end, signal));
  assert.ok(
    Buffer.compare(bytes, FILE.subarray(start, end)) === 0,
    `bytes ${start} to ${end} differ (${bytes.length} were read)`,
  );
}

/** Read like a decoder: the head in small steps, the end, then blocks. */
async function assertReadsLikeDecoder(source) {
  await assertReads(source, 0, 120);
  await assertReads(source, 120, 3000);
  if (source.size !== null) await assertReads(source, SIZE - 14, SIZE);
  for (let start = 3000; start < SIZE; start += 40_000) {
    await assertReads(source, start, Math.min(SIZE, start + 40_000));
  }
  await assertReads(source, SIZE - 10, SIZE + 1000);
  assert.equal(source.size, SIZE);
  source.close();
}

function rejects(what, promise, message, type = errors.SourceError) {
  return assert.rejects(withTimeout(what, promise), (error) => {
    assert.ok(error instanceof type, `${error?.constructor?.name}: ${error?.message}`);
    assert.ok(["SourceError", "InvalidInputError"].includes(error.name), error.name);
    assert.match(error.message, message);
    return true;
  });
}

describe("a well-behaved server", { concurrency: true }, () => {
  test("with ranges is requested only for the bytes that are read", async () => {
    const address = server.address();
    const source = await openWithTimeout(address);
    assert.equal(source.hasRanges, true);
    assert.equal(source.size, SIZE);
    await assertReads(source, 10, 5000);
    await assertReads(source, 100_000, 100_100);
    await assertReads(source, 65_000, 66_000);
    await assertReads(source, 199_990, 300_000);
    assert.deepEqual(server.requestsOf(address), [
      "bytes=0-65535",
      "bytes=100000-100099",
      "bytes=65536-65999",
      "bytes=199990-199999",
    ]);
  });

  test("is requested for all of a small file when its first bytes are read", async () => {
    const small = await startServer(FILE.slice(0, 100_000));
    try {
      const address = small.address();
      const source = await openWithTimeout(address);
      await assertReads(source, 10, 5000);
      const all = withTimeout("the rest", source.read(0, 100_000));
      assert.deepEqual(await all, FILE.slice(0, 100_000));
      assert.deepEqual(small.requestsOf(address), ["bytes=0-65535", "bytes=65536-99999"]);
    } finally {
      small.close();
    }
  });

  test("is requested once for bytes of concurrent reads", async () => {
    const address = server.address({ latencyMs: 30 });
    const source = await openWithTimeout(address);
    const first = assertReads(source, 100_000, 120_000);
    await new Promise((resolve) => setTimeout(resolve, 10));
    await Promise.all([
      first,
      assertReads(source, 110_000, 130_000),
      assertReads(source, 90_000, 140_000),
      assertReads(source, 100_000, 120_000),
    ]);
    const ranges = server.requestsOf(address).slice(1).sort();
    assert.deepEqual(ranges, [
      "bytes=100000-119999",
      "bytes=120000-129999",
      "bytes=130000-139999",
      "bytes=90000-99999",
    ]);
  });

  test("returns no bytes for an empty read and after the end", async () => {
    const source = await openWithTimeout(server.address());
    assert.equal((await source.read(100_000, 100_000)).length, 0);
    assert.equal((await source.read(SIZE + 5, SIZE + 9)).length, 0);
    await rejects("a read", source.read(5, 4), /0 <= start <= end/, errors.InvalidInputError);
    await rejects("a read", source.read(-1, 4), /0 <= start <= end/, errors.InvalidInputError);
  });

  for (const validators of ["both", "etag", "modified", "none"]) {
    for (const ranges of ["yes", "no"]) {
      test(`sends each byte once with validators "${validators}", ranges "${ranges}"`, async () => {
        for (const size of [1000, HEAD, HEAD + 1, SIZE]) {
          const other = await startServer(FILE.subarray(0, size));
          try {
            const address = other.address({ validators, ranges });
            const source = await openWithTimeout(address);
            await assertReads(source, 0, size);
            const nSent = other.bytesSentTo(address);
            assert.ok(nSent <= size + OVERLAP, `${nSent} bytes of ${size} were sent`);
          } finally {
            other.close();
          }
        }
      });
    }
  }

  test("without validators sends the rest in one response", async () => {
    const address = server.address({ validators: "none" });
    const source = await openWithTimeout(address);
    assert.equal(source.hasRanges, false);
    await assertReadsLikeDecoder(source);
    const rest = `bytes=${HEAD - OVERLAP}-${SIZE - 1}`;
    assert.deepEqual(server.requestsOf(address), ["bytes=0-65535", rest]);
  });

  test("without ranges is requested once", async () => {
    const address = server.address({ ranges: "no" });
    const source = await openWithTimeout(address);
    assert.equal(source.hasRanges, false);
    await assertReadsLikeDecoder(source);
    assert.deepEqual(server.requestsOf(address), ["bytes=0-65535"]);
  });

  test("without ranges provides received bytes during the download", async () => {
    const source = await openWithTimeout(server.address({ ranges: "no", latencyMs: 200, rate: 250_000 }));
    const started = performance.now();
    await assertReads(source, 0, 3000);
    const head = performance.now() - started;
    await assertReadsLikeDecoder(source);
    const whole = performance.now() - started;
    assert.ok(head < whole / 2, `head after ${head} ms, all after ${whole} ms`);
  });

  test("at 200 ms and 2 Mbit/s provides the head before the first range is complete", async () => {
    const source = await openWithTimeout(server.address({ latencyMs: 200, rate: 250_000 }));
    const started = performance.now();
    await assertReads(source, 0, 3000);
    const head = performance.now() - started;
    await assertReads(source, 0, HEAD);
    const lead = performance.now() - started;
    assert.ok(head < lead / 2, `head after ${head} ms, first range after ${lead} ms`);
    await assertReadsLikeDecoder(source);
  });

  for (const behavior of [
    { gzip: "yes" },
    { gzip: "yes", chunked: "yes" },
    { gzip: "ranges" },
    { ranges: "no", chunked: "yes" },
    { chunked: "yes" },
    { validators: "none" },
    { validators: "etag" },
    { validators: "modified" },
  ]) {
    test(`with ${JSON.stringify(behavior)} provides the file`, async () => {
      const source = await openWithTimeout(server.address(behavior));
      const hasRanges = !behavior.gzip && !behavior.ranges && behavior.validators !== "none";
      assert.equal(source.hasRanges, hasRanges);
      await assertReadsLikeDecoder(source);
    });
  }

  test("provides empty files and files shorter than the first request", async () => {
    for (const size of [0, 1, 1000, HEAD, HEAD + 1]) {
      const other = await startServer(FILE.subarray(0, size));
      try {
        for (const ranges of ["yes", "no"]) {
          const source = await openWithTimeout(other.address({ ranges }));
          assert.equal(source.size, size);
          const bytes = await withTimeout("all bytes", source.read(0, size + 10));
          assert.ok(Buffer.compare(bytes, FILE.subarray(0, size)) === 0, `${size}, ${ranges}`);
        }
      } finally {
        other.close();
      }
    }
  });

  test("receives the headers of the caller", async () => {
    let seen;
    const { address } = await scripted((request, response) => {
      seen = request.headers.authorization;
      response.end("bytes");
    });
    const source = await openWithTimeout(new URL(address), { headers: { Authorization: "Basic me" } });
    assert.equal(Buffer.from(await source.read(0, 10)).toString(), "bytes");
    assert.equal(seen, "Basic me");
  });
});

describe("a server that closes connections", { concurrency: true }, () => {
  test("after every 20,000 bytes is requested for the missing bytes", async () => {
    const address = server.address({ cut: 20_000 });
    const source = await openWithTimeout(address, { retries: 0 });
    await assertReads(source, 0, HEAD);
    await assertReads(source, 100_000, 130_000);
    assert.deepEqual(server.requestsOf(address), [
      "bytes=0-65535",
      "bytes=20000-65535",
      "bytes=40000-65535",
      "bytes=60000-65535",
      "bytes=100000-129999",
      "bytes=120000-129999",
    ]);
  });

  test("twice, without ranges, provides the file", async () => {
    const source = await openWithTimeout(server.address({ ranges: "no", cut: 70_000, cuts: 2 }));
    await assertReadsLikeDecoder(source);
  });

  test("twice, without Content-Length, provides the file", async () => {
    const source = await openWithTimeout(server.address({ chunked: "yes", cut: 9000, cuts: 2 }));
    await assertReadsLikeDecoder(source);
  });

  test("always, without ranges, provides the received bytes and an error for the rest", async () => {
    const source = await openWithTimeout(server.address({ ranges: "no", cut: 70_000 }), { retries: 1 });
    await assertReads(source, 0, 69_000);
    await rejects("the rest", source.read(69_000, 80_000), /127.0.0.1.*lost at byte 70000 .*again/);
    await assertReads(source, 1000, 70_000);
  });

  test("immediately is retried as often as allowed", async () => {
    const address = server.address({ cut: 1 });
    const source = await openWithTimeout(address, { retries: 2 });
    await rejects("bytes", source.read(0, 99), /lost at byte 3 /);
    const ranges = ["bytes=0-65535", "bytes=1-65535", "bytes=2-65535"];
    assert.deepEqual(server.requestsOf(address), ranges);
  });

  test("on range requests is requested for the whole file", async () => {
    const address = server.address({ ranges: "cut" });
    const source = await openWithTimeout(address);
    assert.equal(source.hasRanges, false);
    await assertReadsLikeDecoder(source);
    assert.deepEqual(server.requestsOf(address), ["bytes=0-65535", null]);
  });

  test("once is requested again by the next read if there are no retries", async () => {
    const source = await openWithTimeout(server.address({ cut: 1000, cuts: 1 }), { retries: 0 });
    await rejects("bytes that were cut", source.read(0, 5000), /lost at byte 1000 /);
    await assertReads(source, 0, 5000);
  });

  test("or stalls is reconnected", async () => {
    for (const ranges of ["yes", "no"]) {
      const address = server.address({ ranges, stall: 20_000, stalls: 1 });
      const source = await openWithTimeout(address, { stallSeconds: 0.2 });
      await assertReads(source, 0, HEAD);
    }
  });

  test("or sends nothing causes an error", async () => {
    for (const [nBytes, end] of [[0, 0], [3000, 6000]]) {
      // Bytes in memory are read before any timer fires, however slow the machine is.
      const request = async (start) => {
        const sent = FILE.subarray(start, start + nBytes);
        const body = new ReadableStream({ start: (stream) => nBytes && stream.enqueue(sent) });
        return { start, end: SIZE, isFramed: true, body };
      };
      const silent = { name: "silent", size: SIZE, hasRanges: true, request };
      const source = new RemoteSource(silent, { retries: 1, stallMs: 10 });
      const message = new RegExp(`silent: received fewer than 4096 bytes in 0.01 s up to byte ${end};`);
      await rejects("bytes", source.read(0, HEAD), message);
      source.close();
    }
  });

  test("or does not respond causes an error", async () => {
    const address = server.address({ latencyMs: 400 });
    const opening = openSource(address, { stallSeconds: 0.1, retries: 0 });
    await rejects("the opening", opening, /^http:\S+: received fewer than 4096 bytes in 0.1 s up to byte 0;/);
  });

  test("that never ends is given up", { timeout: TIMEOUT_MS }, async () => {
    const bomb = gzipSync(new Uint8Array(50e6));
    const answers = {
      "endlessly": (response) => Readable.from(zeros(64)).pipe(response.writeHead(200)),
      "compressed": (response) => response.writeHead(200, { "content-encoding": "gzip" }).end(bomb),
      "of a terabyte": (response) => response.writeHead(200, { "content-length": 2 ** 40 }).write("a"),
      "with a size": (response) => response.writeHead(200, { "content-length": 64e6 }).end(new Uint8Array(64e6)),
    };
    for (const [how, answer] of Object.entries(answers)) {
      const { address } = await scripted((request, response) => {
        assert.equal(request.headers["accept-encoding"], "identity");
        answer(response);
      });
      const opening = openWithTimeout(address, { memory: 1e6, retries: 0 });
      const read = opening.then((source) => source.read(0, 64e6).finally(() => source.close()));
      await rejects(`bytes ${how}`, read, /more than 1000000 bytes would .* `memory`$/);
    }
  });

  test("or arrives in drops causes an error", { timeout: TIMEOUT_MS }, async () => {
    const { address } = await scripted((request, response) => {
      const drops = setInterval(() => response.write("a"), 10);
      response.on("close", () => clearInterval(drops));
    });
    const source = await openWithTimeout(address, { stallSeconds: 0.3, retries: 0 });
    await rejects("drops", source.read(0, 5000), /received fewer than 4096 bytes in 0.3 s/);
  });

  test("is not trusted for ranges without Content-Length", async () => {
    const { address, ranges } = await scripted(
      headResponse,
      (...all) => cut(rangeResponse(100_000, 110_000, FILE.subarray(0, 5000))(...all)),
      (...all) => rangeResponse(100_000, 102_000, FILE.subarray(100_000, 102_000))(...all).end(),
      (...all) => rangeResponse(102_000, 110_000, FILE.subarray(102_000, 110_000))(...all).end(),
    );
    const source = await openWithTimeout(address);
    await assertReads(source, 100_000, 110_000);
    const again = "bytes=100000-109999";
    assert.deepEqual(ranges, ["bytes=0-65535", again, again, "bytes=102000-109999"]);
  });
});

describe("a server with faulty responses", { concurrency: true }, () => {
  const harmless = [
    { fault: "noRange" },
    { fault: "oddRange" },
    { fault: "laterRange" },
    { fault: "wholeBody" },
    { fault: "lengthLonger" },
    { fault: "lengthShorter" },
    { fault: "refused" },
    { fault: "longRange", faultFrom: 1 },
    { fault: "whole", faultFrom: 1 },
    { fault: "whole", faultFrom: 2, chunked: "yes" },
  ];
  for (const behavior of harmless) {
    test(`${JSON.stringify(behavior)} is handled`, async () => {
      const source = await openWithTimeout(server.address(behavior));
      assert.equal(source.hasRanges, "faultFrom" in behavior);
      await assertReadsLikeDecoder(source);
    });
  }

  test("with short ranges is requested for the rest", async () => {
    const address = server.address({ fault: "shortRange" });
    const source = await openWithTimeout(address);
    await assertReads(source, 100_000, 112_000);
    const ranges = server.requestsOf(address).filter((range) => range.startsWith("bytes=1"));
    assert.deepEqual(ranges.filter((range) => range.endsWith("-111999")), [
      "bytes=100000-111999",
      "bytes=105000-111999",
      "bytes=110000-111999",
    ]);
  });

  const harmful = [
    [{ fault: "noRange", faultFrom: 1 }, /request for bytes=100000-109999 returned HTTP 206 .*do not match/],
    [{ fault: "oddRange", faultFrom: 1 }, /Content-Range "bytes 1-0\/0, 9+".*do not match/],
    [{ fault: "laterRange", faultFrom: 1 }, /Content-Range "bytes 100010-109999\/200000".*do not match/],
    [{ fault: "earlierRange", faultFrom: 1 }, /Content-Range "bytes 99990-109999\/200000".*do not match/],
    [{ fault: "longRange", faultFrom: 1, chunked: "yes" }, /Content-Range "bytes 100000-159999\/.*do not match/],
    [{ fault: "oldRange", faultFrom: 1 }, /Content-Range "bytes 0-99\/200000".*do not match/],
    [{ fault: "wholeBody", faultFrom: 1 }, /Content-Length "200000".*do not match/],
    [{ fault: "wholeBody", faultFrom: 1, chunked: "yes" }, /sent more bytes than it announced, 10000;/],
    [{ fault: "wholeBody", faultFrom: 1, chunked: "yes", rate: 100_000 }, /sent more bytes/],
    [{ fault: "noVersion", faultFrom: 1 }, /has changed/],
    [{ fault: "lengthLonger", faultFrom: 1 }, /Content-Length "11000".*do not match/],
    [{ fault: "lengthShorter", faultFrom: 1 }, /Content-Length "9000".*do not match/],
    [{ fault: "totalLarger", faultFrom: 1 }, /has changed since it was opened; open it again/],
    [{ fault: "totalSmaller", faultFrom: 1 }, /has changed/],
    [{ fault: "refused", faultFrom: 1 }, /has changed/],
  ];
  for (const [behavior, message] of harmful) {
    test(`${JSON.stringify(behavior)} is detected`, async () => {
      const source = await openWithTimeout(server.address(behavior));
      await rejects("bytes", source.read(100_000, 110_000), message);
      await assertReads(source, 0, HEAD);
    });
  }

  test("with a larger announced size is detected at the end", async () => {
    const source = await openWithTimeout(server.address({ fault: "totalLarger" }), { retries: 1 });
    await assertReads(source, 190_000, SIZE);
    await rejects("bytes that are not there", source.read(SIZE - 10, SIZE + 10), /has changed/);
  });

  test("with a larger Content-Length is detected at the end", async () => {
    const address = server.address({ ranges: "no", fault: "bodyShorter" });
    const source = await openWithTimeout(address, { retries: 0 });
    await assertReads(source, 0, SIZE);
    assert.equal(source.size, SIZE + 1000);
    await rejects("the end", source.read(SIZE, SIZE + 10), /lost at byte 200000 /);
  });

  test("with a smaller Content-Length provides the right bytes up to there", async () => {
    const source = await openWithTimeout(server.address({ ranges: "no", fault: "bodyLonger" }));
    assert.equal(source.size, SIZE - 1000);
    await assertReads(source, 0, SIZE - 1000);
  });
});

describe("a file that changes", { concurrency: true }, () => {
  for (const behavior of [
    { validators: "both" },
    { validators: "etag" },
    { validators: "modified" },
    { validators: "both", fault: "whole", faultFrom: 1 },
    { validators: "both", longer: 1000 },
  ]) {
    test(`is detected with ${JSON.stringify(behavior)}`, async () => {
      const source = await openWithTimeout(server.address({ ...behavior, changeAfter: 1 }));
      await rejects("new bytes", source.read(100_000, 100_100), /has changed .*open it again/);
      await assertReads(source, 0, HEAD);
    });
  }

  test("during the first range is detected", async () => {
    const source = await openWithTimeout(server.address({ cut: 20_000, cuts: 1, changeAfter: 1 }));
    await rejects("bytes of both", source.read(0, HEAD), /has changed/);
    await assertReads(source, 0, 20_000);
  });

  test("and is shorter than the received bytes is detected", async () => {
    const { address } = await scripted(
      (_, response) => {
        response.writeHead(200).write(FILE.subarray(0, 70_000));
        cut(response);
      },
      (_, response) => response.writeHead(200).end(FILE.subarray(0, 50_000)),
    );
    const source = await openWithTimeout(address);
    await rejects("the rest", source.read(0, SIZE), /has changed/);
  });

  for (const behavior of [{}, { longer: 1000 }, { fault: "whole", faultFrom: 1 }, { cut: 10_000 }]) {
    test(`without validators is detected, with ${JSON.stringify(behavior)}`, async () => {
      const how = { ...behavior, validators: "none", changeAfter: 1 };
      const source = await openWithTimeout(server.address(how), { retries: 1 });
      await rejects("bytes of both", source.read(0, SIZE), /has changed/);
      await assertReads(source, 0, 10_000);
    });
  }

  test("without validators, and becomes shorter, is detected", async () => {
    const { address } = await scripted(
      (_, response) => {
        const range = `bytes 0-${HEAD - 1}/${SIZE}`;
        response.writeHead(206, { "content-range": range }).end(FILE.subarray(0, HEAD));
      },
      (_, response) => response.writeHead(416, { "content-range": "bytes */50000" }).end(),
    );
    const source = await openWithTimeout(address);
    await rejects("the rest", source.read(0, SIZE), /has changed/);
  });

  for (const behavior of [
    { validators: "both" },
    { validators: "none" },
    { validators: "none", longer: 1000 },
    { validators: "none", chunked: "yes" },
  ]) {
    test(`is detected without ranges, with ${JSON.stringify(behavior)}`, async () => {
      const how = { ...behavior, ranges: "no", cut: 70_000, cuts: 1, changeAfter: 1 };
      const source = await openWithTimeout(server.address(how));
      await rejects("bytes of both", source.read(0, SIZE), /has changed/);
      await assertReads(source, 0, 69_000);
    });
  }
});

describe("a server with several faults at once", { concurrency: 20 }, () => {
  const CHOICES = {
    ranges: ["yes", "yes", "yes", "no"],
    validators: ["both", "etag", "modified", "none"],
    cut: [0, 0, 5000, 30_000],
    cuts: [1, 3],
    chunked: ["no", "no", "yes"],
    gzip: ["no", "no", "no", "yes", "ranges"],
    fault: ["", "", "shortRange", "earlierRange", "laterRange", "whole", "wholeBody", "oldRange"]
      .concat("noRange", "refused", "lengthLonger", "lengthShorter", "bodyShorter", "bodyLonger")
      .concat("totalLarger", "totalSmaller"),
    faultFrom: [0, 1, 2],
    changeAfter: [1e9, 1e9, 1, 2, 3],
    longer: [0, 1000],
    status: [200, 200, 503],
    failures: [1],
  };
  const OTHER = FILE.map((value) => value ^ 255);
  const random = randomBytes(1e6);
  let nDrawn = 0;
  const draw = (below) => (random[nDrawn++] * 256 + random[nDrawn++]) % below;

  for (let number = 0; number < Number(process.env.N_MIXED ?? 60); number++) {
    const entries = Object.entries(CHOICES).map(([key, all]) => [key, all[draw(all.length)]]);
    const behavior = Object.fromEntries(entries);
    const starts = [0, 1000, HEAD - 500, ...Array.from({ length: 4 }, () => draw(65536) * 3)];
    test(`${number}: provides bytes of one version, or an error`, async () => {
      const address = server.address(behavior);
      let version = null;
      const read = async (source, start) => {
        const bytes = await source.read(start, start + 20_000);
        const end = Math.min(start + 20_000, source.size ?? Infinity);
        assert.equal(bytes.length, Math.max(0, end - start));
        const inBoth = Math.min(end, SIZE);
        if (inBoth <= start) return;
        const isOf = (file) =>
          Buffer.compare(bytes.subarray(0, inBoth - start), file.subarray(start, inBoth)) === 0;
        version ??= isOf(FILE) ? FILE : OTHER;
        assert.ok(isOf(version), `wrong bytes ${start} to ${inBoth} from ${address}`);
      };
      const ignoreSourceError = (error) => {
        if (!(error instanceof errors.SourceError)) throw error;
      };
      await withTimeout(address, (async () => {
        const source = await openSource(address, { retries: 1, stallSeconds: 2 });
        for (const start of starts.slice(0, 3)) await read(source, start).catch(ignoreSourceError);
        await Promise.all(starts.slice(3).map((start) => read(source, start).catch(ignoreSourceError)));
        source.close();
      })().catch(ignoreSourceError));
    });
  }
});

describe("a server that provides no file", { concurrency: true }, () => {
  for (const [status, message, nRequests] of [
    [404, /127.0.0.1.*: HTTP 404; there is no such file, check the address/, 1],
    [403, /HTTP 403; .*credentials or headers/, 1],
    [400, /HTTP 400; /, 1],
    [500, /HTTP 500; .*try again later/, 2],
    [503, /HTTP 503; .*try again later/, 2],
  ]) {
    test(`but ${status} is requested ${nRequests} times`, async () => {
      const address = server.address({ status });
      await rejects("the opening", openSource(address, { retries: 1 }), message);
      assert.equal(server.requestsOf(address).length, nRequests);
    });
  }

  test("at first is requested again", async () => {
    const started = performance.now();
    const reads = ["yes", "no"].map(async (ranges) => {
      const source = await openWithTimeout(server.address({ status: 503, failures: 2, ranges }));
      await assertReadsLikeDecoder(source);
    });
    await Promise.all(reads);
    const passed = performance.now() - started;
    assert.ok(passed > 740, `pauses of 250 and 500 ms took ${passed} ms`);
  });

  test("because it is down causes an error", async () => {
    const gone = await startServer(FILE);
    const address = gone.address();
    gone.close();
    const opening = openSource(address, { retries: 1 });
    await rejects("the opening", opening, /cannot be reached \(.*check the address/);
  });

  test("any more causes an error for missing bytes", async () => {
    const going = await startServer(FILE);
    const source = await openWithTimeout(going.address(), { retries: 1 });
    await assertReads(source, 0, HEAD);
    going.close();
    await rejects("bytes", source.read(100_000, 100_100), /cannot be reached/);
    await assertReads(source, 0, HEAD);
  });

  test("because the address is invalid causes an error immediately", async () => {
    await rejects("x", openSource("http://["), /http:.*cannot be/, errors.InvalidInputError);
  });
});

describe("players of one address", { concurrency: true }, () => {
  const { signal } = new AbortController();

  test("request its bytes once, as long as one is open", async () => {
    const address = server.address({ latencyMs: 30 });
    const open = () => withTimeout("the opening", openShared(address, signal));
    const all = await Promise.all(Array.from({ length: 18 }, open));
    for (const source of all) {
      assert.deepEqual([source.size, source.hasRanges], [SIZE, true]);
      await assertReads(source, 0, 100);
      await assertReads(source, 100_000, 140_000);
      source.close();
      source.close(); // has no effect
    }
    assert.deepEqual(server.requestsOf(address), ["bytes=0-65535", "bytes=100000-139999"]);
    const later = await open();
    await assertReads(later, 0, 100);
    assert.deepEqual(server.requestsOf(address).slice(2), ["bytes=0-65535"]);
    later.close();
  });

  test("keep the bytes that another one waits for when one leaves, and stop when all have left", async () => {
    const address = server.address({ latencyMs: 200 });
    const controllers = [new AbortController(), new AbortController()];
    const opening = controllers.map((controller) => openShared(address, controller.signal));
    controllers[0].abort();
    await assert.rejects(opening[0], { name: "AbortError" });
    const source = await withTimeout("the opening", opening[1]);
    await assertReads(source, 0, 100);
    const read = source.read(100_000, 140_000);
    source.close();
    await assert.rejects(withTimeout("a read", read), { name: "AbortError" });
    await assert.rejects(openShared(address, AbortSignal.abort()), { name: "AbortError" });
  });

  test("all get the error, and request the file again when they open it again", async () => {
    const address = server.address({ status: 404, failures: 1, latencyMs: 30 });
    const open = () => withTimeout("the opening", openShared(address, signal));
    const opening = [open(), open()];
    for (const one of opening) await assert.rejects(one, /HTTP 404/);
    const source = await open();
    await assertReads(source, 0, 100);
    assert.equal(server.requestsOf(address).length, 2);
    source.close();
  });

  test("get the new version when they open a changed file again", async () => {
    const address = server.address({ changeAfter: 1 });
    const source = await openShared(address, signal);
    await assert.rejects(source.read(100_000, 100_100), /has changed/);
    const other = await openShared(address, signal);
    assert.equal((await other.read(0, 1))[0], FILE[0] ^ 255);
    source.close();
    assert.equal((await openShared(address, signal)).size, SIZE);
    assert.equal(server.requestsOf(address).length, 3);
    other.close();
  });

  test("keep the bytes read last, up to a limit", async () => {
    const address = server.address();
    const source = await openRemote(address, {}, {}, 50_000);
    for (const start of [70_000, 100_000, 130_000, 100_010, 130_010, 70_010]) {
      await assertReads(source, start, start + 20_000 - (start % 1000));
    }
    const ranges = ["0-65535", "70000-89999", "100000-119999", "130000-149999", "70010-89999"];
    assert.deepEqual(server.requestsOf(address), ranges.map((range) => `bytes=${range}`));
    source.close();
  });
});

describe("aborting", { concurrency: true }, () => {
  const slow = { latencyMs: 500 };
  const soon = () => new Promise((resolve) => setTimeout(resolve, 50));

  function isAborted(what, promise) {
    return assert.rejects(withTimeout(what, promise), { name: "AbortError" });
  }

  test("before the start prevents it", async () => {
    const signal = AbortSignal.abort();
    await isAborted("the opening", openSource(server.address(), { signal }));
    const source = await openWithTimeout(server.address());
    await isAborted("a read", source.read(0, 10, signal));
  });

  test("ends opening immediately", async () => {
    const controller = new AbortController();
    const address = server.address({ latencyMs: 3000 });
    const opening = openSource(address, { signal: controller.signal });
    setTimeout(() => controller.abort(), 50);
    const started = performance.now();
    await isAborted("the opening", opening);
    assert.ok(performance.now() - started < 2500);
  });

  test("ends the pause before a retry immediately", async () => {
    const controller = new AbortController();
    const address = server.address({ status: 503 });
    const opening = openSource(address, { signal: controller.signal, retries: 9 });
    const nRequests = () => server.requestsOf(address).length;
    while (!nRequests()) await soon();
    controller.abort();
    await isAborted("the opening", opening);
    await soon();
    assert.equal(nRequests(), 1);
  });

  test("ends one read but not others of the same bytes", async () => {
    const source = await openWithTimeout(server.address(slow));
    const controller = new AbortController();
    const read = source.read(100_000, 101_000, controller.signal);
    const other = assertReads(source, 100_000, 102_000);
    await soon();
    controller.abort();
    await isAborted("a read", read);
    await other;
  });

  test("closes the connection if no read needs it", async () => {
    let isGone = false;
    const { address, ranges } = await scripted(
      headResponse,
      (...all) => {
        const bytes = FILE.subarray(100_000, 101_000);
        rangeResponse(100_000, 150_000, bytes)(...all).on("close", () => (isGone = true));
      },
      (...all) => rangeResponse(100_000, 100_100, FILE.subarray(100_000, 100_100))(...all).end(),
    );
    const source = await openWithTimeout(address);
    const controller = new AbortController();
    const read = source.read(100_000, 150_000, controller.signal);
    await soon();
    controller.abort();
    await isAborted("a read", read);
    for (let tries = 0; tries < 100 && !isGone; tries++) await soon(); // on a busy machine
    assert.ok(isGone);
    // Requested again: the received bytes are not cached.
    await assertReads(source, 100_000, 100_100);
    assert.deepEqual(ranges.slice(1), [
      "bytes=100000-149999",
      "bytes=100000-100099",
    ]);
  });

  test("ends the source with the given reason", async () => {
    const controller = new AbortController();
    const { signal } = controller;
    const source = await openWithTimeout(server.address({ ranges: "no", rate: 20_000 }), { signal });
    const read = source.read(0, SIZE);
    const reason = new Error("enough");
    controller.abort(reason);
    await assert.rejects(withTimeout("a read", read), reason);
    await assert.rejects(source.read(0, 10), reason);
  });

  test("happens when the source is closed", async () => {
    for (const ranges of ["yes", "no"]) {
      const source = await openWithTimeout(server.address({ ranges, rate: 20_000 }));
      const read = source.read(0, SIZE);
      source.close();
      await isAborted("a read", read);
      await isAborted("a read", source.read(0, 10));
    }
  });
});

describe("other sources", { concurrency: true }, () => {
  for (const [what, from] of [
    ["a buffer", FILE.buffer],
    ["an array", FILE],
    ["a blob", new Blob([FILE])],
  ]) {
    test(`reads from ${what} return copies`, async () => {
      const source = await openWithTimeout(from);
      assert.equal(source.hasRanges, true);
      await assertReadsLikeDecoder(source);
      const bytes = await source.read(0, 10);
      bytes.fill(0);
      await assertReads(source, 0, 10);
      await rejects("a read", source.read(3, 2), /bytes 3 to 2 /, errors.InvalidInputError);
      await assert.rejects(source.read(0, 1, AbortSignal.abort()), { name: "AbortError" });
    });
  }

  test("other values are rejected", async () => {
    const type = errors.InvalidInputError;
    await rejects("the opening", openSource(7), /\[object Number\]; pass/, type);
    await rejects("the opening", openSource(null), /\[object Null\]; pass/, type);
    await rejects("the opening", openSource(new Response(FILE)), /\[object Response\]; pass/, type);
  });
});
