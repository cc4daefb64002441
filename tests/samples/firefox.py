"""Firefox on a screen that nobody sees: without one it has no WebGL 2."""

import json
import os
import shutil
import signal
import subprocess
from contextlib import contextmanager
from pathlib import Path
from queue import Empty
from tempfile import TemporaryDirectory

import pytest

PATIENCE_S = 120
SETTINGS = {
    "browser.shell.checkDefaultBrowser": False,
    "browser.aboutwelcome.enabled": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "toolkit.telemetry.reportingpolicy.firstRun": False,
}


def require_screen():
    """Skips where Firefox cannot draw: headless, it has no WebGL 2."""
    for program in ("firefox", "xvfb-run"):
        if shutil.which(program) is None:
            pytest.skip(f"needs {program}: without a screen Firefox has no WebGL 2")


def said_by(url, posted):
    """What a page that Firefox opens posts first, into the queue of its server."""
    with _opened(url):
        try:
            return json.loads(posted.get(timeout=PATIENCE_S))
        except Empty:
            pytest.fail(f"Firefox said nothing for {PATIENCE_S} s")


@contextmanager
def _opened(url):
    # The browser may still write into its profile while that is removed.
    with TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        lines = [f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in SETTINGS.items()]
        Path(profile, "user.js").write_text("\n".join(lines), "utf-8")
        screen = ["xvfb-run", "--auto-servernum", "--server-args=-screen 0 1280x720x24"]
        command = [*screen, "firefox", "--no-remote", "--profile", profile, url]
        silent = subprocess.DEVNULL
        # A group of their own: xvfb-run leaves what it has started behind.
        process = subprocess.Popen(command, stdout=silent, stderr=silent, start_new_session=True)
        try:
            yield
        finally:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()
