"""Firefox on a virtual screen: headless, it has no WebGL 2."""

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
    """Skip the test if Firefox or the virtual screen is missing."""
    for program in ("firefox", "xvfb-run"):
        if shutil.which(program) is None:
            pytest.skip(f"needs {program}: without a screen Firefox has no WebGL 2")


def message_of(url, posted):
    """Return the first message that a page in Firefox posts to its server."""
    with _opened(url):
        try:
            return json.loads(posted.get(timeout=PATIENCE_S))
        except Empty:
            pytest.fail(f"Firefox said nothing for {PATIENCE_S} s")


@contextmanager
def _opened(url):
    # The browser may still write to its profile during removal.
    with TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        lines = [f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in SETTINGS.items()]
        Path(profile, "user.js").write_text("\n".join(lines), "utf-8")
        screen = ["xvfb-run", "--auto-servernum", "--server-args=-screen 0 1280x720x24"]
        command = [*screen, "firefox", "--no-remote", "--profile", profile, url]
        silent = subprocess.DEVNULL
        # A separate process group: xvfb-run does not stop its children.
        process = subprocess.Popen(command, stdout=silent, stderr=silent, start_new_session=True)
        try:
            yield
        finally:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()
