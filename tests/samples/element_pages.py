"""Pages with the element <reel-player>, and helpers for tests."""

import io
import time
from contextlib import ExitStack, contextmanager

import numpy as np
from PIL import Image

from samples.web_package import serving

POLICY = {
    "Content-Security-Policy": "default-src 'self'; worker-src blob:; img-src 'self' data:;"
    " script-src 'self' 'wasm-unsafe-eval'"
}
PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>A page</title>
<link rel="icon" href="data:,"><link rel="stylesheet" href="/page.css">
<script type="module" src="/dist/player.js"></script>
<main><h1>A page</h1>{body}</main></html>"""
PATIENCE_S = 60
SMALL = {"width": 640, "height": 480}
"""The size of pages, which Chromium draws in software."""


@contextmanager
def showing(new_page, files, headers=POLICY):
    """Return a function that opens a page with a body; `player` is its first player.

    `files` are bytes by path, and `headers` come with every answer. Further arguments of the
    function are those of the fixture `new_page`.
    """
    with ExitStack() as servers:

        def show(body, **given):
            pages = {**files, "/page.html": PAGE.format(body=body).encode()}
            url, _ = servers.enter_context(serving(pages, headers))
            page = new_page(f"{url}/page.html", is_shown=False, **{**SMALL, **given})
            until(page, "customElements.get('reel-player')")
            page.evaluate("window.player = document.querySelector('reel-player')")
            return page

        yield show


def until(page, condition):
    """Wait for a condition; the pages' policy blocks `wait_for_function`."""
    end = time.monotonic() + PATIENCE_S
    while not page.evaluate(f"!!({condition})"):
        assert time.monotonic() < end, f"waited {PATIENCE_S} s for {condition}"
        page.wait_for_timeout(20)


def settled(page):
    """Wait until the file is open and drawn."""
    until(page, "player.mesh && !player.mesh.isWaiting && player.mesh.geometry.drawRange.count > 0")
    page.wait_for_timeout(200)


def text_of(page, selector):
    return page.evaluate(
        "selector => player.shadowRoot.querySelector(selector).textContent", selector
    )


def picture(page):
    return np.asarray(
        Image.open(io.BytesIO(page.locator("reel-player").first.screenshot())).convert("RGB"), int
    )


def drawn_fraction(page):
    """Return the fraction of the element that is not white."""
    return (np.abs(picture(page) - 255).max(axis=2) > 12).mean()


def press(page, selector, *keys):
    """Focus a part of the player, and press keys."""
    page.evaluate("selector => player.shadowRoot.querySelector(selector).focus()", selector)
    for key in keys:
        page.keyboard.press(key)
