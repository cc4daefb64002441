"""Reads in a page from misbehaving servers of another origin."""

import itertools
import subprocess
from functools import partial
from http.server import SimpleHTTPRequestHandler
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pytest

from samples.web_package import built_package
from samples.web_server import local_server

NPM = Path(__file__).parents[2] / "npm"
ESBUILD = NPM / "node_modules" / ".bin" / "esbuild"
SIZE = 200_000
RANGES = ((0, 300), (150_000, 150_300), (SIZE - 10, SIZE + 1000))

READ = """async ([address, options, ranges]) => {
    const { openSource } = await import("/source.js");
    try {
        const source = await openSource(address, options);
        const parts = [];
        for (const [start, end] of ranges) parts.push([...(await source.read(start, end))]);
        const { hasRanges, size } = source;
        source.close();
        return { hasRanges, size, parts };
    } catch (error) {
        return { error: `${error.name}: ${error.message}` };
    }
}"""


@pytest.fixture(scope="module")
def content():
    return np.random.default_rng(7).bytes(SIZE)


@pytest.fixture(scope="module")
def page(browser, tmp_path_factory):
    """A page with the modules of `npm/src/source` as a script."""
    built_package()
    folder = tmp_path_factory.mktemp("site")
    (folder / "index.html").write_text("<!doctype html><title>Bytes</title>")
    bundle = ("--bundle", "--format=esm", "--log-level=error", f"--outfile={folder / 'source.js'}")
    subprocess.run([ESBUILD, NPM / "src" / "source" / "open.ts", *bundle], check=True)
    handler = partial(SimpleHTTPRequestHandler, directory=folder)
    with local_server(handler) as address:
        opened = browser.new_page()
        opened.goto(f"{address}/")
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def address_of(content, tmp_path_factory):
    """Addresses of a server that misbehaves as their query requests; one per test."""
    path = tmp_path_factory.mktemp("served") / "file"
    path.write_bytes(content)
    command = ["node", NPM / "test" / "server.mjs", path]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        base = server.stdout.readline().split("?")[0]
        numbers = itertools.count()
        yield lambda **how: f"{base}?{urlencode({**how, 'number': next(numbers)})}"
        server.terminate()


def read(page, address, **options):
    return page.evaluate(READ, [address, options, RANGES])


@pytest.mark.parametrize(
    ("how", "has_ranges"),
    [
        ({}, True),
        ({"cut": 20_000, "cuts": 2}, True),
        ({"chunked": "yes"}, True),
        ({"fault": "whole", "faultFrom": 1}, True),
        # Another site must let pages see Content-Range.
        ({"cors": "plain"}, False),
        ({"ranges": "no"}, False),
        ({"ranges": "no", "cors": "plain", "cut": 70_000, "cuts": 1}, False),
        # Chromium rejects compressed ranges.
        ({"gzip": "yes"}, False),
        ({"gzip": "ranges", "cors": "plain"}, False),
        ({"fault": "noRange"}, False),
    ],
)
def test_bytes_are_right_when_a_server_misbehaves(page, address_of, content, how, has_ranges):
    came = read(page, address_of(**how), retries=2)
    assert came == {
        "hasRanges": has_ranges,
        "size": SIZE,
        "parts": [list(content[start:end]) for start, end in RANGES],
    }


@pytest.mark.parametrize(
    ("how", "options", "message"),
    [
        ({"changeAfter": 1}, {}, "has changed since it was opened; open it again"),
        # Chromium would report the old ETag with bytes that its cache requested by If-Range.
        ({"changeAfter": 1, "ifRange": "no"}, {}, "has changed"),
        ({"changeAfter": 1}, {"cache": "default"}, "has changed"),
        ({"cors": "none"}, {"retries": 1}, "that the server sends Access-Control-Allow-Origin"),
        ({"ranges": "no", "fault": "bodyShorter"}, {"retries": 0}, "was lost at byte 200000"),
        ({"stall": 100}, {"retries": 0, "stallSeconds": 0.2}, "bytes in 0.2 s up to byte 100"),
        ({"status": 404}, {}, "HTTP 404; there is no such file"),
    ],
)
def test_error_is_descriptive_when_bytes_cannot_be_read(page, address_of, how, options, message):
    error = read(page, address_of(**how), **options)["error"]
    assert error.startswith("SourceError: http://127.0.0.1:")
    assert message in error


def test_custom_headers_send_a_preflight_when_the_origin_differs(page, address_of):
    assert read(page, address_of(), headers={"X-Key": "1"})["hasRanges"]
    assert "error" in read(page, address_of(cors="none"), headers={"X-Key": "1"}, retries=0)
