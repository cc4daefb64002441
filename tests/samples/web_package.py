"""The npm package, built once, and a web server with range requests."""

import fcntl
import importlib.util
import shutil
import sys
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import pytest

from samples.programs import output_of
from samples.web_server import QuietHandler, local_server

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "npm"
DIST = PACKAGE / "dist"
SOURCES = (
    *("npm/src", "npm/site", "npm/build.mjs", "npm/package-lock.json", "core"),
    *("npm/tsconfig.json", "npm/tsconfig.package.json", "npm/tsconfig.player.json"),
)


THREE_PAGE = """<!doctype html><title>page</title><link rel="icon" href="data:,">
<script type="importmap">{"imports": {"three": "/three/three.module.js",
"meshreel": "/dist/index.js", "meshreel/three": "/dist/three.js"}}</script>"""
"""A page that can import three.js and the package."""


def three_files(page=THREE_PAGE):
    """Return the page and the scripts of three.js, by path."""
    built_package()
    scripts = (PACKAGE / "node_modules" / "three" / "build").glob("three*.js")
    return {
        "/index.html": page.encode(),
        **{f"/three/{path.name}": path.read_bytes() for path in scripts},
    }


def built_package():
    """Return the folder of the built scripts; skip the test if they cannot be built."""
    if shutil.which("npm") is None:
        pytest.skip("needs Node (npm)")
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip("needs ziglang")
    with (PACKAGE / ".building").open("w") as lock:  # several workers may ask at once
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not _is_current():
            for words in (["ci", "--no-audit", "--no-fund"], ["run", "build:package"]):
                environment = {"PYTHON": sys.executable}
                output_of("npm", *words, cwd=PACKAGE, environment=environment)
    return DIST


def _is_current():
    if not (DIST / "built").exists():
        return False
    made = (DIST / "built").stat().st_mtime
    paths = [ROOT / name for name in SOURCES]
    files = [file for path in paths for file in [path, *path.rglob("*")] if file.is_file()]
    # Other tests import modules of core/, which creates bytecode there.
    sources = [file for file in files if file.suffix != ".pyc"]
    return all(file.stat().st_mtime <= made for file in sources)


@contextmanager
def serving(files, headers=None, posted=None):
    """Serve bytes by path, and the built package; return the address and the requested ranges.

    Every answer has these `headers`. The path "/" is an empty page. Data that a page posts are put
    into the queue `posted`.
    """
    built_package()
    requested = []

    class Handler(QuietHandler, BaseHTTPRequestHandler):
        def do_GET(self):
            path = self.path.partition("?")[0]
            body = files.get(path, b"<!doctype html><title>test</title>" if path == "/" else None)
            if body is None and path.startswith("/dist/") and (DIST / path[6:]).is_file():
                body = (DIST / path[6:]).read_bytes()
            if body is None:
                self.send_error(404)
                return
            self.answer(path, body)

        def answer(self, path, body):
            kinds = {
                ".js": "text/javascript",
                ".wasm": "application/wasm",
                ".reel": "application/octet-stream",
                ".webm": "video/webm",
                ".mp4": "video/mp4",
                ".png": "image/png",
            }
            range_header = self.headers.get("Range")
            if range_header and path.endswith((".reel", ".webm", ".mp4")):
                begin, _, end = range_header.removeprefix("bytes=").partition("-")
                first, last = int(begin), min(int(end or len(body)), len(body) - 1)
                if path.endswith(".reel"):
                    requested.append((first, last))
                self.send_response(206)
                self.send_header("Content-Range", f"bytes {first}-{last}/{len(body)}")
                self.send_header("ETag", '"same"')
                body = body[first : last + 1]
            else:
                self.send_response(200)
            self.send_header("Content-Type", kinds.get(Path(path).suffix, "text/html"))
            self.send_header("Content-Length", str(len(body)))
            for name, value in (headers or {}).items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def do_POST(self):
            posted.put(self.posted())

    with local_server(Handler) as address:
        yield address, requested
