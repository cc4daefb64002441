"""The npm package builds with type checks, and its tests pass."""

import re
import subprocess
from pathlib import Path

import pytest

from samples.npm_projects import packed
from samples.web_package import built_package

PACKAGE = Path(__file__).parents[3] / "npm"
TIME_LIMIT_S = 600

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def built():
    """The folder of the built scripts."""
    return built_package()


@pytest.fixture(scope="module")
def tarball(tmp_path_factory):
    """The archive written by `npm pack`."""
    return packed(tmp_path_factory.mktemp("packed"))


def npm(*command):
    """Return the output of npm; fail the test if npm fails."""
    return output_of("npm", *command)


def output_of(*command):
    """Run a command in the package folder and return its output; fail the test if it fails."""
    found = subprocess.run(
        command,
        cwd=PACKAGE,
        timeout=TIME_LIMIT_S,
        capture_output=True,
        text=True,
    )
    assert not found.returncode, found.stdout + found.stderr
    return found.stdout


def test_the_package_is_built_with_both_cores(built):
    for name in ("index.js", "three.js", "plain_wasm.js", "index.d.ts", "three/index.d.ts"):
        assert (built / name).is_file(), name


@pytest.mark.parametrize(
    "check",
    [("publint", "--strict"), ("attw", "--profile", "esm-only")],
    ids=["publint", "attw"],
)
def test_published_package_resolves_when_bundlers_and_node_import_it(tarball, check):
    tool, *options = check
    output_of(PACKAGE / "node_modules" / ".bin" / tool, tarball, *options)


def test_the_tests_of_the_package_pass(built):
    told = npm("test")
    assert re.search(r"^. pass [1-9]", told, re.MULTILINE), told
    assert re.search(r"^. fail 0$", told, re.MULTILINE), told
