"""The package for pages: it is built, its types hold, and its own tests pass."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[3] / "npm"
TIME_LIMIT_S = 600

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="needs ziglang"),
    pytest.mark.skipif(shutil.which("npm") is None, reason="needs Node (npm)"),
]


def npm(*command):
    """What npm says; the test fails with it where it fails."""
    found = subprocess.run(
        [shutil.which("npm"), *command],
        cwd=PACKAGE,
        env={**os.environ, "PYTHON": sys.executable},
        timeout=TIME_LIMIT_S,
        capture_output=True,
        text=True,
    )
    assert not found.returncode, found.stdout + found.stderr
    return found.stdout


@pytest.fixture(scope="module")
def built():
    if not (PACKAGE / "node_modules").exists():
        npm("ci", "--no-audit", "--no-fund", "--fetch-retries=1")
    return npm("run", "build")


def test_the_package_is_built_with_both_cores(built):
    assert re.search(r"dist/index\.js: \d+ bytes, \d+ after gzip", built)
    assert re.search(r"dist/plain_wasm\.js: \d+ bytes", built)
    assert (PACKAGE / "dist" / "index.d.ts").exists()


def test_the_types_of_the_package_hold(built):
    npm("run", "check")


def test_the_tests_of_the_package_pass(built):
    told = npm("test")
    assert re.search(r"^. pass [1-9]", told, re.MULTILINE), told
    assert re.search(r"^. fail 0$", told, re.MULTILINE), told
