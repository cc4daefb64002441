"""Players in a browser, and the commands that create them."""

import base64
import io
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
from PIL import Image

COMMAND = (sys.executable, "-c", "from meshreel.app.cli import main; main()")


@contextmanager
def viewing(path, *options):
    """Start `meshreel view`; return the process and its address."""
    command = [*COMMAND, "view", str(path), "--no-open", *map(str, options)]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "COLUMNS": "200"}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        told = next((line for line in process.stdout if "http://" in line), "")
        yield process, re.findall(r"http://\S+", told)[0]
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)


def array_of(page, expression, dtype):
    text = page.evaluate(
        f"""() => {{
            const bytes = new Uint8Array(({expression}).buffer);
            let text = "";
            for (let i = 0; i < bytes.length; i += 4096)
                text += String.fromCharCode(...bytes.subarray(i, i + 4096));
            return btoa(text);
        }}"""
    )
    return np.frombuffer(base64.b64decode(text), dtype)


def positions_of(page):
    """Return the drawn positions, of shape (V, 3)."""
    return array_of(page, "player.positions()", np.float32).reshape(-1, 3)


def values_of(page):
    """Return the values that color the decoded mesh, of shape (V,)."""
    return array_of(page, "player.heatValues()", np.float32)


def show(page, frame):
    page.evaluate("frame => player.seek(frame)", frame)


def wait_for_player(page):
    """Wait until the player shows its first frame."""
    wait_until(page, "window.player !== undefined")
    page.evaluate("player.ready")


def put_to_rest(page):
    """Show the first frame without heat map, paused."""
    page.evaluate("player.takeOver()")
    page.evaluate("player.pause()")
    page.evaluate("player.setHeat(null)")
    show(page, 0)


def wait_until(page, condition, limit_s=20.0):
    """Wait for a condition in JavaScript; the page's policy blocks playwright's own function."""
    end = time.monotonic() + limit_s
    while not page.evaluate(condition):
        assert time.monotonic() < end, condition
        page.wait_for_timeout(20)


def state_of(page):
    return page.evaluate("player.state()")


def picture_of(page, selector=None):
    """Return pixels of the page or of an element, of shape (height, width, 3)."""
    shown = page.locator(selector) if selector else page
    with Image.open(io.BytesIO(shown.screenshot())) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def covered(picture):
    """Return a mask of pixels that differ from the lower right corner."""
    return np.abs(picture - picture[-3, -3]).max(axis=2) > 12
