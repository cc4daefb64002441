"""A headless browser driven by playwright, and glTF files that it plays."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler
from pathlib import Path
from queue import Empty, Queue

import numpy as np
import pytest

from samples.web_server import QuietHandler, local_server

FOLDER = Path(__file__).parents[1] / "integration" / "gltf_in_browser"
PATIENCE_S = 120

DRIVEN = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
DRAWN_BY_SOFTWARE = (  # so that no graphics card is needed
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",  # in software rendering, it costs more than it saves
    "--js-flags=--expose-gc",
)


AXE = Path(__file__).parents[2] / "npm" / "node_modules" / "axe-core" / "axe.min.js"


def checked_rules(page, scope=""):
    """Assert that axe finds no violations; return the ids of the rules that apply."""
    if not AXE.is_file():
        pytest.skip("needs axe-core: npm ci in npm/")
    page.evaluate(AXE.read_text("utf-8"))
    report = page.evaluate(f"axe.run({scope})")
    violations = [(rule["id"], [node["html"] for node in rule["nodes"]])
                  for rule in report["violations"]]  # fmt: skip
    assert violations == []
    return {rule["id"] for rule in report["passes"]}


@contextmanager
def driven_browser():
    """Start a browser; skip the test if none is installed."""
    driver = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    path = next(filter(None, map(shutil.which, DRIVEN)), None)
    if path is None:
        pytest.skip(f"needs one of {', '.join(DRIVEN)}")
    with driver.sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=path, args=DRAWN_BY_SOFTWARE)
        yield launched
        launched.close()


def play(page, file, times_s):
    """Return positions at each time, of shape (times, vertices, 3), and a PNG of the last."""
    with _server(file) as (address, posted):
        page.goto(f"{address}/play.html?times={','.join(map(repr, map(float, times_s)))}")
        answers = dict(_answers(posted))
    positions = np.frombuffer(answers["/positions"], "<f8")
    return positions.reshape(len(times_s), -1, 3), answers["/picture"]


def shown_title(page, file):
    """Return the title of a page that shows a file in model-viewer, once it changes."""
    with _server(file) as (address, _):
        page.goto(f"{address}/stock.html")
        page.wait_for_function("document.title", timeout=PATIENCE_S * 1000)
        return page.title()


def _answers(posted):
    for _ in range(2):
        try:
            path, body = posted.get(timeout=PATIENCE_S)
        except Empty:
            raise AssertionError(f"the browser said nothing for {PATIENCE_S} s") from None
        assert path != "/error", body.decode()
        yield path, body


@contextmanager
def _server(file) -> Iterator[tuple[str, Queue]]:
    posted: Queue[tuple[str, bytes]] = Queue()

    class Handler(QuietHandler, SimpleHTTPRequestHandler):
        def __init__(self, *given):
            super().__init__(*given, directory=str(FOLDER))

        def translate_path(self, path):
            return str(file) if path == "/scene.glb" else super().translate_path(path)

        def do_POST(self):
            posted.put((self.path, self.posted()))

    with local_server(Handler) as address:
        yield address, posted
