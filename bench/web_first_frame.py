"""Time to the first frame in a browser, from the arrival of the last byte to positions.

    python bench/web_first_frame.py samba.npz --pages 15 --out web_first_frame.json

Every page is cold: a new context in headless Chromium, which recompiles all code. The page imports
the package, opens the stream and requests its first frame: from memory, or from a server that
responds immediately or after a delay, during which the package initializes. A second stream on the
same page measures compiled code. Several builds (--dist) alternate, because machines are never
quiet. Build the package first: `npm run build` in npm/.
"""

import argparse
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from statistics import median, quantiles
from typing import Any

import meshreel
from measuring import machine_text, print_table, store

ROOT = Path(__file__).parents[1]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = ["--headless=new", "--no-sandbox"]
SETTLED_MS = 200
"""Wait for the page to finish loading and to release previous data."""

HEADER = ["bytes come from", "build", "first frame ms", "quarter to three quarters",
          "best", "from the call on", "second stream"]  # fmt: skip

FIRST_FRAMES = """async ([build, inMemory, settledMs]) => {
  const { ReelFile } = await import(`/${build}/index.js`);
  const settled = () => new Promise((resolve) => setTimeout(resolve, settledMs));
  const found = [];
  for (const name of ["first", "second"]) {
    await settled();
    const address = new URL(`/${name}.reel`, location);
    const bytes = inMemory ? await (await fetch(address)).arrayBuffer() : null;
    const called = performance.now();
    const reel = await ReelFile.open(bytes ?? address);
    await reel.frame(0);
    const done = performance.now();
    const ends = performance.getEntriesByName(address.href).map((answer) => answer.responseEnd);
    const arrived = bytes ? called : Math.max(...ends);
    found.push({ fromArrival: done - arrived, fromCall: done - called, inWorker: reel.isInWorker });
    reel.close();
  }
  return found;
}"""


@contextmanager
def serving(stream: bytes, builds: list[Path], delay_s: float) -> Iterator[str]:
    """Serve scripts, and ranges of the stream after a delay; yield the address."""

    class Handler(BaseHTTPRequestHandler):
        wbufsize = -1  # send header and body together

        def do_GET(self) -> None:
            kind, body, byte_range = "text/html", b"<!doctype html>", self.headers.get("Range")
            _, folder, *rest = self.path.split("/")
            if rest:
                kind, body = "text/javascript", builds[int(folder)].joinpath(*rest).read_bytes()
            elif folder.endswith(".reel"):
                time.sleep(delay_s)
                kind, body = "application/octet-stream", stream
            self.send_response(206 if byte_range else 200)
            if byte_range:
                begin, _, last = byte_range.removeprefix("bytes=").partition("-")
                body = body[int(begin) : int(last) + 1]
                of_all = f"{begin}-{int(begin) + len(body) - 1}/{len(stream)}"
                self.send_header("Content-Range", f"bytes {of_all}")
                self.send_header("ETag", '"same"')
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *given: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def measure(
    browser: Any, url: str, n_builds: int, in_memory: bool, n_pages: int
) -> list[list[Any]]:
    """Measure pages of all builds alternately; return the results of each build."""
    results: list[list[Any]] = [[] for _ in range(n_builds)]
    for _ in range(n_pages):
        for build in range(n_builds):
            context = browser.new_context()
            page = context.new_page()
            page.goto(url)
            page.wait_for_load_state()
            results[build].append(page.evaluate(FIRST_FRAMES, [build, in_memory, SETTLED_MS]))
            context.close()
    assert all(frame["inWorker"] for pages in results for page in pages for frame in page)
    return results


def row(way: str, build: Path, pages: list[Any]) -> list[str]:
    """The cells of a build and a source of bytes."""
    first = [page[0]["fromArrival"] for page in pages]
    low, _, high = quantiles(first, n=4)
    return [
        way,
        str(build),
        f"{median(first):.0f}",
        f"{low:.0f}..{high:.0f}",
        f"{min(first):.0f}",
        f"{median(page[0]['fromCall'] for page in pages):.0f}",
        f"{median(page[1]['fromArrival'] for page in pages):.0f}",
    ]


def main() -> None:
    """Measure, print a table, and write JSON if requested."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("input", type=Path, help="a stream, or a sequence to encode")
    parser.add_argument("--dist", type=Path, nargs="+", default=[ROOT / "npm" / "dist"])
    parser.add_argument("--pages", type=int, default=15, help="of each build and way")
    parser.add_argument("--delays-ms", default="0,50", help="of the server, before each answer")
    parser.add_argument("--out", type=Path, help="write the figures here as JSON")
    options = parser.parse_args()
    if options.input.suffix == ".reel":
        stream = options.input.read_bytes()
    else:
        stream = meshreel.encode(meshreel.load(options.input))
    ways = [("memory", True, 0.0)]
    for delay in map(float, options.delays_ms.split(",")):
        ways.append((f"an address, {delay:g} ms", False, delay / 1000))
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        parser.error(f"needs one of {', '.join(BROWSERS)}")
    results, rows = [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        for way, in_memory, delay_s in ways:
            with serving(stream, options.dist, delay_s) as url:
                result = measure(browser, url, len(options.dist), in_memory, options.pages)
            for build, pages in zip(options.dist, result, strict=True):
                results.append({"way": way, "build": str(build), "pages": pages})
                rows.append(row(way, build, pages))
        browser.close()
    info = meshreel.info(stream)
    print(
        f"**{info.name}**: {info.n_frames} frames of {info.n_verts} vertices, {len(stream)} bytes. "
        f"Medians of {options.pages} cold pages. {machine_text()}\n"
    )
    print_table("", HEADER, rows)
    store(options.out, stream_bytes=len(stream), results=results)


if __name__ == "__main__":
    main()
