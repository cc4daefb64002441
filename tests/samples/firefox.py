"""Firefox, headless or on a virtual screen: headless, it has no WebGL 2."""

import json
import os
import shutil
import signal
import subprocess
from contextlib import contextmanager
from pathlib import Path
from queue import Empty, Queue
from tempfile import TemporaryDirectory

import pytest

from samples.web_package import serving

PATIENCE_S = 120
SETTINGS = {
    "browser.shell.checkDefaultBrowser": False,
    "browser.aboutwelcome.enabled": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "toolkit.telemetry.reportingpolicy.firstRun": False,
}


def message_of(files, path, *, is_headless=False):
    """Serve files to Firefox; return the first message that a page posts to the server."""
    for program in ("firefox",) if is_headless else ("firefox", "xvfb-run"):
        if shutil.which(program) is None:
            pytest.skip(f"needs {program}")
    posted = Queue()
    with serving(files, posted=posted) as (url, _), _opened(f"{url}{path}", is_headless):
        try:
            return json.loads(posted.get(timeout=PATIENCE_S))
        except Empty:
            pytest.fail(f"Firefox posted nothing for {PATIENCE_S} s")


@contextmanager
def _opened(url, is_headless):
    # The browser may still write to its profile during removal.
    with TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        lines = [f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in SETTINGS.items()]
        Path(profile, "user.js").write_text("\n".join(lines), "utf-8")
        screen = ["xvfb-run", "--auto-servernum", "--server-args=-screen 0 1280x720x24"]
        start = ["firefox", "--headless"] if is_headless else [*screen, "firefox"]
        command = [*start, "--no-remote", "--profile", profile, url]
        silent = subprocess.DEVNULL
        # A separate process group: xvfb-run does not stop its children.
        process = subprocess.Popen(command, stdout=silent, stderr=silent, start_new_session=True)
        try:
            yield
        finally:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()
