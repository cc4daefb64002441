// Bytes from servers that behave badly: the right ones, or an error that says what is wrong.

import assert from "node:assert/strict";
import { createServer } from "node:http";
import { after, before, describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { startServer } from "./server.mjs";

const SIZE = 200_000;
const LEAD = 65536;
/** Bytes that are sent twice, and compared, without ETag and Last-Modified. */
const OVERLAP = 64;
const LIMIT_MS = 30_000;

/** No two windows of some bytes are the same. */
function madeUpBytes(size) {
  const bytes = new Uint8Array(size);
  let state = 12345;
  for (let i = 0; i < size; i++) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    bytes[i] = state >>> 24;
  }
  return bytes;
}

const FILE = madeUpBytes(SIZE);
let server;
let openSource, RemoteSource, errors;

before(async () => {
  const folder = fileURLToPath(new URL("../src", import.meta.url));
  const { outputFiles } = await build({
    stdin: {
      contents:
        'export { openSource } from "./source/open"; export { RemoteSource } from "./source/remote";' +
        'export * as errors from "./errors";',
      resolveDir: folder,
    },
    bundle: true,
    format: "esm",
    write: false,
  });
  const script = Buffer.from(outputFiles[0].contents).toString("base64");
  ({ openSource, RemoteSource, errors } = await import(`data:text/javascript;base64,${script}`));
  server = await startServer(FILE);
});
after(() => server.close());

/** Fails where a promise takes longer than it may, and says what was waited for. */
async function inTime(what, promise) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`waited ${LIMIT_MS} ms for ${what}`)), LIMIT_MS);
  });
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}

/** A server whose answers are written out: each a function of the request and the response. */
async function scripted(...answers) {
  const asked = [];
  const other = createServer((request, response) => {
    asked.push(request.headers.range);
    answers[asked.length - 1](request, response);
  });
  await new Promise((resolve) => other.listen(0, "127.0.0.1", resolve));
  after(() => other.close().closeAllConnections());
  return { address: `http://127.0.0.1:${other.address().port}/`, asked };
}

/** An answer that says that it holds a range, and what it does hold. */
function sendsRange(start, end, bytes, headers = {}) {
  return (request, response) => {
    const range = { "content-range": `bytes ${start}-${end - 1}/${SIZE}`, etag: '"one"' };
    response.writeHead(206, { ...range, ...headers }).write(bytes);
    return response;
  };
}

const sendsLead = (...all) => sendsRange(0, LEAD, FILE.subarray(0, LEAD))(...all).end();

/** Cuts the connection once what was sent has gone out. */
function cut(response) {
  setTimeout(() => response.destroy(), 20);
}

function opened(address, options) {
  return inTime(`the opening of ${address}`, openSource(address, options));
}

async function assertReads(source, start, end, signal) {
  const bytes = await inTime(`bytes ${start} to ${end}`, source.read(start, end, signal));
  assert.ok(
    Buffer.compare(bytes, FILE.subarray(start, end)) === 0,
    `bytes ${start} to ${end} are others (${bytes.length} came)`,
  );
}

/** Reads as a decoder does: the head in small steps, the end, then blocks. */
async function assertReadsAsADecoder(source) {
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
  return assert.rejects(inTime(what, promise), (error) => {
    assert.ok(error instanceof type, `${error?.constructor?.name}: ${error?.message}`);
    assert.ok(["SourceError", "InvalidInputError"].includes(error.name), error.name);
    assert.match(error.message, message);
    return true;
  });
}

describe("an honest server", { concurrency: true }, () => {
  test("with ranges is asked for what is read, and no more", async () => {
    const address = server.address();
    const source = await opened(address);
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

  test("is asked for all of a small file, though only its first bytes are read", async () => {
    const small = await startServer(FILE.slice(0, 100_000));
    try {
      const address = small.address();
      const source = await opened(address);
      await assertReads(source, 10, 5000);
      const all = inTime("the rest", source.read(0, 100_000));
      assert.deepEqual(await all, FILE.slice(0, 100_000));
      assert.deepEqual(small.requestsOf(address), ["bytes=0-65535", "bytes=65536-99999"]);
    } finally {
      small.close();
    }
  });

  test("is asked once for bytes that several read at once", async () => {
    const address = server.address({ latencyMs: 30 });
    const source = await opened(address);
    const first = assertReads(source, 100_000, 120_000);
    await new Promise((resolve) => setTimeout(resolve, 10));
    await Promise.all([
      first,
      assertReads(source, 110_000, 130_000),
      assertReads(source, 90_000, 140_000),
      assertReads(source, 100_000, 120_000),
    ]);
    const asked = server.requestsOf(address).slice(1).sort();
    assert.deepEqual(asked, [
      "bytes=100000-119999",
      "bytes=120000-129999",
      "bytes=130000-139999",
      "bytes=90000-99999",
    ]);
  });

  test("gives no bytes for an empty read and behind the end", async () => {
    const source = await opened(server.address());
    assert.equal((await source.read(100_000, 100_000)).length, 0);
    assert.equal((await source.read(SIZE + 5, SIZE + 9)).length, 0);
    await rejects("a read", source.read(5, 4), /0 <= start <= end/, errors.InvalidInputError);
    await rejects("a read", source.read(-1, 4), /0 <= start <= end/, errors.InvalidInputError);
  });

  for (const validators of ["both", "etag", "modified", "none"]) {
    for (const ranges of ["yes", "no"]) {
      test(`sends each byte once with validators "${validators}", ranges "${ranges}"`, async () => {
        for (const size of [1000, LEAD, LEAD + 1, SIZE]) {
          const other = await startServer(FILE.subarray(0, size));
          try {
            const address = other.address({ validators, ranges });
            const source = await opened(address);
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

  test("without versions sends the rest in one answer", async () => {
    const address = server.address({ validators: "none" });
    const source = await opened(address);
    assert.equal(source.hasRanges, false);
    await assertReadsAsADecoder(source);
    const rest = `bytes=${LEAD - OVERLAP}-${SIZE - 1}`;
    assert.deepEqual(server.requestsOf(address), ["bytes=0-65535", rest]);
  });

  test("without ranges is asked once, for all", async () => {
    const address = server.address({ ranges: "no" });
    const source = await opened(address);
    assert.equal(source.hasRanges, false);
    await assertReadsAsADecoder(source);
    assert.deepEqual(server.requestsOf(address), ["bytes=0-65535"]);
  });

  test("without ranges gives what has come while the rest is on its way", async () => {
    const source = await opened(server.address({ ranges: "no", latencyMs: 200, rate: 250_000 }));
    const started = performance.now();
    await assertReads(source, 0, 3000);
    const head = performance.now() - started;
    await assertReadsAsADecoder(source);
    const whole = performance.now() - started;
    assert.ok(head < whole / 2, `head after ${head} ms, all after ${whole} ms`);
  });

  test("at 200 ms and 2 Mbit/s gives the head before all of the first range", async () => {
    const source = await opened(server.address({ latencyMs: 200, rate: 250_000 }));
    const started = performance.now();
    await assertReads(source, 0, 3000);
    const head = performance.now() - started;
    await assertReads(source, 0, LEAD);
    const lead = performance.now() - started;
    assert.ok(head < lead / 2, `head after ${head} ms, first range after ${lead} ms`);
    await assertReadsAsADecoder(source);
  });

  for (const behaviour of [
    { gzip: "yes" },
    { gzip: "yes", chunked: "yes" },
    { gzip: "ranges" },
    { ranges: "no", chunked: "yes" },
    { chunked: "yes" },
    { validators: "none" },
    { validators: "etag" },
    { validators: "modified" },
  ]) {
    test(`with ${JSON.stringify(behaviour)} gives the file`, async () => {
      const source = await opened(server.address(behaviour));
      const hasRanges = !behaviour.gzip && !behaviour.ranges && behaviour.validators !== "none";
      assert.equal(source.hasRanges, hasRanges);
      await assertReadsAsADecoder(source);
    });
  }

  test("gives files of no bytes and of fewer than are asked for first", async () => {
    for (const size of [0, 1, 1000, LEAD, LEAD + 1]) {
      const other = await startServer(FILE.subarray(0, size));
      try {
        for (const ranges of ["yes", "no"]) {
          const source = await opened(other.address({ ranges }));
          assert.equal(source.size, size);
          const bytes = await inTime("all bytes", source.read(0, size + 10));
          assert.ok(Buffer.compare(bytes, FILE.subarray(0, size)) === 0, `${size}, ${ranges}`);
        }
      } finally {
        other.close();
      }
    }
  });

  test("gets the headers that the user gives", async () => {
    let seen;
    const { address } = await scripted((request, response) => {
      seen = request.headers.authorization;
      response.end("bytes");
    });
    const source = await opened(new URL(address), { headers: { Authorization: "Basic me" } });
    assert.equal(Buffer.from(await source.read(0, 10)).toString(), "bytes");
    assert.equal(seen, "Basic me");
  });
});

describe("a server that cuts connections", { concurrency: true }, () => {
  test("behind 20,000 bytes each time is asked for what is missing", async () => {
    const address = server.address({ cut: 20_000 });
    const source = await opened(address, { retries: 0 });
    await assertReads(source, 0, LEAD);
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

  test("twice, without ranges, gives the file", async () => {
    const source = await opened(server.address({ ranges: "no", cut: 70_000, cuts: 2 }));
    await assertReadsAsADecoder(source);
  });

  test("twice, without lengths, gives the file", async () => {
    const source = await opened(server.address({ chunked: "yes", cut: 9000, cuts: 2 }));
    await assertReadsAsADecoder(source);
  });

  test("always, without ranges, gives what came, and an error for the rest", async () => {
    const source = await opened(server.address({ ranges: "no", cut: 70_000 }), { retries: 1 });
    await assertReads(source, 0, 69_000);
    await rejects("the rest", source.read(69_000, 80_000), /127.0.0.1.*cut at byte 70000 .*again/);
    await assertReads(source, 1000, 70_000);
  });

  test("at once is asked again as often as allowed", async () => {
    const address = server.address({ cut: 1 });
    const source = await opened(address, { retries: 2 });
    await rejects("bytes", source.read(0, 99), /cut at byte 3 /);
    const asked = ["bytes=0-65535", "bytes=1-65535", "bytes=2-65535"];
    assert.deepEqual(server.requestsOf(address), asked);
  });

  test("where ranges are asked for is asked for the whole file", async () => {
    const address = server.address({ ranges: "cut" });
    const source = await opened(address);
    assert.equal(source.hasRanges, false);
    await assertReadsAsADecoder(source);
    assert.deepEqual(server.requestsOf(address), ["bytes=0-65535", null]);
  });

  test("once is asked anew by the next read if it must not be by the first", async () => {
    const source = await opened(server.address({ cut: 1000, cuts: 1 }), { retries: 0 });
    await rejects("bytes that were cut", source.read(0, 5000), /cut at byte 1000 /);
    await assertReads(source, 0, 5000);
  });

  test("or sends nothing more is left for a new connection", async () => {
    for (const ranges of ["yes", "no"]) {
      const address = server.address({ ranges, stall: 20_000, stalls: 1 });
      const source = await opened(address, { stallSeconds: 0.2 });
      await assertReads(source, 0, LEAD);
    }
  });

  test("or sends nothing at all gives an error", async () => {
    for (const [nBytes, end] of [[0, 0], [3000, 6000]]) {
      // Bytes in memory are read before any timer fires, however slow the machine is.
      const ask = async (start) => {
        const sent = FILE.subarray(start, start + nBytes);
        const body = new ReadableStream({ start: (stream) => nBytes && stream.enqueue(sent) });
        return { start, end: SIZE, isFramed: true, body };
      };
      const silent = { name: "silent", size: SIZE, hasRanges: true, ask };
      const source = new RemoteSource(silent, { retries: 1, stallMs: 10 });
      const message = new RegExp(`silent: nothing came for 0.01 s behind byte ${end};`);
      await rejects("bytes", source.read(0, LEAD), message);
      source.close();
    }
  });

  test("or does not answer gives an error", async () => {
    const address = server.address({ latencyMs: 400 });
    const opening = openSource(address, { stallSeconds: 0.1, retries: 0 });
    await rejects("the opening", opening, /^http:\S+: nothing came for 0.1 s behind byte 0;/);
  });

  test("is not believed what it has sent without a length", async () => {
    const { address, asked } = await scripted(
      sendsLead,
      (...all) => cut(sendsRange(100_000, 110_000, FILE.subarray(0, 5000))(...all)),
      (...all) => sendsRange(100_000, 102_000, FILE.subarray(100_000, 102_000))(...all).end(),
      (...all) => sendsRange(102_000, 110_000, FILE.subarray(102_000, 110_000))(...all).end(),
    );
    const source = await opened(address);
    await assertReads(source, 100_000, 110_000);
    const again = "bytes=100000-109999";
    assert.deepEqual(asked, ["bytes=0-65535", again, again, "bytes=102000-109999"]);
  });
});

describe("a server that lies", { concurrency: true }, () => {
  const harmless = [
    { lie: "noRange" },
    { lie: "oddRange" },
    { lie: "laterRange" },
    { lie: "wholeBody" },
    { lie: "lengthLonger" },
    { lie: "lengthShorter" },
    { lie: "refused" },
    { lie: "earlierRange", lieFrom: 1 },
    { lie: "whole", lieFrom: 1 },
    { lie: "whole", lieFrom: 2, chunked: "yes" },
  ];
  for (const behaviour of harmless) {
    test(`${JSON.stringify(behaviour)} is seen through`, async () => {
      const source = await opened(server.address(behaviour));
      assert.equal(source.hasRanges, "lieFrom" in behaviour);
      await assertReadsAsADecoder(source);
    });
  }

  test("by ranges that are too short is asked for the rest", async () => {
    const address = server.address({ lie: "shortRange" });
    const source = await opened(address);
    await assertReads(source, 100_000, 112_000);
    const asked = server.requestsOf(address).filter((range) => range.startsWith("bytes=1"));
    assert.deepEqual(asked.filter((range) => range.endsWith("-111999")), [
      "bytes=100000-111999",
      "bytes=105000-111999",
      "bytes=110000-111999",
    ]);
  });

  const harmful = [
    [{ lie: "noRange", lieFrom: 1 }, /asked for bytes=100000-109999 and answered HTTP 206 .*fit/],
    [{ lie: "oddRange", lieFrom: 1 }, /Content-Range "bytes 1-0\/0, 9+".*fit/],
    [{ lie: "laterRange", lieFrom: 1 }, /Content-Range "bytes 100010-109999\/200000".*fit/],
    [{ lie: "oldRange", lieFrom: 1 }, /Content-Range "bytes 0-99\/200000".*fit/],
    [{ lie: "wholeBody", lieFrom: 1 }, /Content-Length "200000".*fit/],
    [{ lie: "wholeBody", lieFrom: 1, chunked: "yes" }, /more bytes came .*announced, 10000;/],
    [{ lie: "wholeBody", lieFrom: 1, chunked: "yes", rate: 100_000 }, /more bytes came/],
    [{ lie: "noVersion", lieFrom: 1 }, /has changed/],
    [{ lie: "lengthLonger", lieFrom: 1 }, /Content-Length "11000".*fit/],
    [{ lie: "lengthShorter", lieFrom: 1 }, /Content-Length "9000".*fit/],
    [{ lie: "totalLarger", lieFrom: 1 }, /has changed since it was opened; open it again/],
    [{ lie: "totalSmaller", lieFrom: 1 }, /has changed/],
    [{ lie: "refused", lieFrom: 1 }, /has changed/],
  ];
  for (const [behaviour, message] of harmful) {
    test(`${JSON.stringify(behaviour)} is found out`, async () => {
      const source = await opened(server.address(behaviour));
      await rejects("bytes", source.read(100_000, 110_000), message);
      await assertReads(source, 0, LEAD);
    });
  }

  test("that the file is longer is found out at its end", async () => {
    const source = await opened(server.address({ lie: "totalLarger" }), { retries: 1 });
    await assertReads(source, 190_000, SIZE);
    await rejects("bytes that are not there", source.read(SIZE - 10, SIZE + 10), /has changed/);
  });

  test("that the body is longer is found out at its end", async () => {
    const address = server.address({ ranges: "no", lie: "bodyShorter" });
    const source = await opened(address, { retries: 0 });
    await assertReads(source, 0, SIZE);
    assert.equal(source.size, SIZE + 1000);
    await rejects("the end", source.read(SIZE, SIZE + 10), /cut at byte 200000 /);
  });

  test("that the body is shorter gives the right bytes up to there", async () => {
    const source = await opened(server.address({ ranges: "no", lie: "bodyLonger" }));
    assert.equal(source.size, SIZE - 1000);
    await assertReads(source, 0, SIZE - 1000);
  });
});

describe("a file that changes", { concurrency: true }, () => {
  for (const behaviour of [
    { validators: "both" },
    { validators: "etag" },
    { validators: "modified" },
    { validators: "both", lie: "whole", lieFrom: 1 },
    { validators: "both", longer: 1000 },
  ]) {
    test(`is noticed with ${JSON.stringify(behaviour)}`, async () => {
      const source = await opened(server.address({ ...behaviour, changeAfter: 1 }));
      await rejects("new bytes", source.read(100_000, 100_100), /has changed .*open it again/);
      await assertReads(source, 0, LEAD);
    });
  }

  test("while the first range comes is noticed", async () => {
    const source = await opened(server.address({ cut: 20_000, cuts: 1, changeAfter: 1 }));
    await rejects("bytes of both", source.read(0, LEAD), /has changed/);
    await assertReads(source, 0, 20_000);
  });

  test("and is shorter than what came is noticed", async () => {
    const { address } = await scripted(
      (_, response) => {
        response.writeHead(200).write(FILE.subarray(0, 70_000));
        cut(response);
      },
      (_, response) => response.writeHead(200).end(FILE.subarray(0, 50_000)),
    );
    const source = await opened(address);
    await rejects("the rest", source.read(0, SIZE), /has changed/);
  });

  for (const behaviour of [{}, { longer: 1000 }, { lie: "whole", lieFrom: 1 }, { cut: 10_000 }]) {
    test(`unnoticed by its server is noticed, with ${JSON.stringify(behaviour)}`, async () => {
      const how = { ...behaviour, validators: "none", changeAfter: 1 };
      const source = await opened(server.address(how), { retries: 1 });
      await rejects("bytes of both", source.read(0, SIZE), /has changed/);
      await assertReads(source, 0, 10_000);
    });
  }

  test("unnoticed by its server, and becomes shorter, is noticed", async () => {
    const { address } = await scripted(
      (_, response) => {
        const range = `bytes 0-${LEAD - 1}/${SIZE}`;
        response.writeHead(206, { "content-range": range }).end(FILE.subarray(0, LEAD));
      },
      (_, response) => response.writeHead(416, { "content-range": "bytes */50000" }).end(),
    );
    const source = await opened(address);
    await rejects("the rest", source.read(0, SIZE), /has changed/);
  });

  for (const behaviour of [
    { validators: "both" },
    { validators: "none" },
    { validators: "none", longer: 1000 },
    { validators: "none", chunked: "yes" },
  ]) {
    test(`is noticed without ranges, with ${JSON.stringify(behaviour)}`, async () => {
      const how = { ...behaviour, ranges: "no", cut: 70_000, cuts: 1, changeAfter: 1 };
      const source = await opened(server.address(how));
      await rejects("bytes of both", source.read(0, SIZE), /has changed/);
      await assertReads(source, 0, 69_000);
    });
  }
});

describe("a server that misbehaves in many ways at once", { concurrency: 20 }, () => {
  const CHOICES = {
    ranges: ["yes", "yes", "yes", "no"],
    validators: ["both", "etag", "modified", "none"],
    cut: [0, 0, 5000, 30_000],
    cuts: [1, 3],
    chunked: ["no", "no", "yes"],
    gzip: ["no", "no", "no", "yes", "ranges"],
    lie: ["", "", "shortRange", "earlierRange", "laterRange", "whole", "wholeBody", "oldRange"]
      .concat("noRange", "refused", "lengthLonger", "lengthShorter", "bodyShorter", "bodyLonger")
      .concat("totalLarger", "totalSmaller"),
    lieFrom: [0, 1, 2],
    changeAfter: [1e9, 1e9, 1, 2, 3],
    longer: [0, 1000],
    status: [200, 200, 503],
    failures: [1],
  };
  const OTHER = FILE.map((value) => value ^ 255);
  const random = madeUpBytes(1e6);
  let nDrawn = 0;
  const draw = (below) => (random[nDrawn++] * 256 + random[nDrawn++]) % below;

  for (let number = 0; number < Number(process.env.N_MIXED ?? 60); number++) {
    const entries = Object.entries(CHOICES).map(([key, all]) => [key, all[draw(all.length)]]);
    const behaviour = Object.fromEntries(entries);
    const starts = [0, 1000, LEAD - 500, ...Array.from({ length: 4 }, () => draw(65536) * 3)];
    test(`${number}: gives bytes of one version, or an error`, async () => {
      const address = server.address(behaviour);
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
      const typed = (error) => {
        if (!(error instanceof errors.SourceError)) throw error;
      };
      await inTime(address, (async () => {
        const source = await openSource(address, { retries: 1, stallSeconds: 2 });
        for (const start of starts.slice(0, 3)) await read(source, start).catch(typed);
        await Promise.all(starts.slice(3).map((start) => read(source, start).catch(typed)));
        source.close();
      })().catch(typed));
    });
  }
});

describe("a server that gives no file", { concurrency: true }, () => {
  for (const [status, message, nAsked] of [
    [404, /127.0.0.1.*: HTTP 404; there is no such file, check the address/, 1],
    [403, /HTTP 403; .*credentials or headers/, 1],
    [400, /HTTP 400; /, 1],
    [500, /HTTP 500; .*try again later/, 2],
    [503, /HTTP 503; .*try again later/, 2],
  ]) {
    test(`but ${status} is asked ${nAsked} times`, async () => {
      const address = server.address({ status });
      await rejects("the opening", openSource(address, { retries: 1 }), message);
      assert.equal(server.requestsOf(address).length, nAsked);
    });
  }

  test("at first is asked again", async () => {
    const started = performance.now();
    const reads = ["yes", "no"].map(async (ranges) => {
      const source = await opened(server.address({ status: 503, failures: 2, ranges }));
      await assertReadsAsADecoder(source);
    });
    await Promise.all(reads);
    const passed = performance.now() - started;
    assert.ok(passed > 740, `pauses of 250 and 500 ms took ${passed} ms`);
  });

  test("for it is not there gives an error", async () => {
    const gone = await startServer(FILE);
    const address = gone.address();
    gone.close();
    const opening = openSource(address, { retries: 1 });
    await rejects("the opening", opening, /cannot be reached \(.*check the address/);
  });

  test("and goes away gives an error for what is missing", async () => {
    const going = await startServer(FILE);
    const source = await opened(going.address(), { retries: 1 });
    await assertReads(source, 0, LEAD);
    going.close();
    await rejects("bytes", source.read(100_000, 100_100), /cannot be reached/);
    await assertReads(source, 0, LEAD);
  });

  test("for it cannot be asked gives an error at once", async () => {
    await rejects("x", openSource("walk.reel"), /walk.reel cannot be/, errors.InvalidInputError);
  });
});

describe("aborted work", { concurrency: true }, () => {
  const slow = { latencyMs: 500 };
  const soon = () => new Promise((resolve) => setTimeout(resolve, 50));

  function isAborted(what, promise) {
    return assert.rejects(inTime(what, promise), { name: "AbortError" });
  }

  test("does not begin", async () => {
    const signal = AbortSignal.abort();
    await isAborted("the opening", openSource(server.address(), { signal }));
    const source = await opened(server.address());
    await isAborted("a read", source.read(0, 10, signal));
  });

  test("ends at once: an opening", async () => {
    const controller = new AbortController();
    const address = server.address({ latencyMs: 3000 });
    const opening = openSource(address, { signal: controller.signal });
    setTimeout(() => controller.abort(), 50);
    const started = performance.now();
    await isAborted("the opening", opening);
    assert.ok(performance.now() - started < 2500);
  });

  test("ends at once: a pause before a new question", async () => {
    const controller = new AbortController();
    const address = server.address({ status: 503 });
    const opening = openSource(address, { signal: controller.signal, retries: 9 });
    const asked = () => server.requestsOf(address).length;
    while (!asked()) await soon();
    controller.abort();
    await isAborted("the opening", opening);
    await soon();
    assert.equal(asked(), 1);
  });

  test("ends one read, and not that of another who waits for the same bytes", async () => {
    const source = await opened(server.address(slow));
    const controller = new AbortController();
    const read = source.read(100_000, 101_000, controller.signal);
    const other = assertReads(source, 100_000, 102_000);
    await soon();
    controller.abort();
    await isAborted("a read", read);
    await other;
  });

  test("lets the connection go where nobody waits for it", async () => {
    let isGone = false;
    const { address, asked } = await scripted(
      sendsLead,
      (...all) => {
        const bytes = FILE.subarray(100_000, 101_000);
        sendsRange(100_000, 150_000, bytes)(...all).on("close", () => (isGone = true));
      },
      (...all) => sendsRange(100_000, 100_100, FILE.subarray(100_000, 100_100))(...all).end(),
    );
    const source = await opened(address);
    const controller = new AbortController();
    const read = source.read(100_000, 150_000, controller.signal);
    await soon();
    controller.abort();
    await isAborted("a read", read);
    await soon();
    assert.ok(isGone);
    // Asked anew: the bytes that came before are not kept.
    await assertReads(source, 100_000, 100_100);
    assert.deepEqual(asked.slice(1), [
      "bytes=100000-149999",
      "bytes=100000-100099",
    ]);
  });

  test("ends with the source, for the reason that is given", async () => {
    const controller = new AbortController();
    const { signal } = controller;
    const source = await opened(server.address({ ranges: "no", rate: 20_000 }), { signal });
    const read = source.read(0, SIZE);
    const reason = new Error("enough");
    controller.abort(reason);
    await assert.rejects(inTime("a read", read), reason);
    await assert.rejects(source.read(0, 10), reason);
  });

  test("ends with the source that is closed", async () => {
    for (const ranges of ["yes", "no"]) {
      const source = await opened(server.address({ ranges, rate: 20_000 }));
      const read = source.read(0, SIZE);
      source.close();
      await isAborted("a read", read);
      await isAborted("a read", source.read(0, 10));
    }
  });
});

describe("other sources", { concurrency: true }, () => {
  test("a response is read as it comes", async () => {
    const response = await fetch(server.address({ rate: 400_000 }));
    const source = await opened(response);
    assert.equal(source.hasRanges, false);
    await assertReadsAsADecoder(source);
  });

  test("a response that was made up is read", async () => {
    const source = await opened(new Response(FILE));
    await assertReads(source, 1000, SIZE);
    await assertReads(source, SIZE, SIZE + 1);
    assert.equal(source.size, SIZE);
  });

  test("a response that is cut gives what came, and an error", async () => {
    const source = await opened(await fetch(server.address({ cut: 70_000 })));
    await assertReads(source, 0, 70_000);
    await rejects("the rest", source.read(0, 70_001), /cut at byte 70000|open the address instead/);
    await rejects("the rest", source.read(0, 70_001), /open the address instead/);
  });

  test("a response without the whole file is refused", async () => {
    const part = await fetch(server.address(), { headers: { range: "bytes=0-99" } });
    await rejects("the opening", openSource(part), /not of a whole file \(HTTP 206\)/);
    const missing = await fetch(server.address({ status: 404 }));
    await rejects("the opening", openSource(missing), /not of a whole file \(HTTP 404\)/);
    const used = new Response(FILE);
    await used.arrayBuffer();
    await rejects("the opening", openSource(used), /read already/, errors.InvalidInputError);
  });

  for (const [what, from] of [
    ["a buffer", FILE.buffer],
    ["an array", FILE],
    ["a blob", new Blob([FILE])],
  ]) {
    test(`${what} gives copies of its bytes`, async () => {
      const source = await opened(from);
      assert.equal(source.hasRanges, true);
      await assertReadsAsADecoder(source);
      const bytes = await source.read(0, 10);
      bytes.fill(0);
      await assertReads(source, 0, 10);
      await rejects("a read", source.read(3, 2), /bytes 3 to 2 /, errors.InvalidInputError);
      await assert.rejects(source.read(0, 1, AbortSignal.abort()), { name: "AbortError" });
    });
  }

  test("anything else is refused", async () => {
    const type = errors.InvalidInputError;
    await rejects("the opening", openSource(7), /\[object Number\]; give/, type);
    await rejects("the opening", openSource(null), /\[object Null\]; give/, type);
  });
});
