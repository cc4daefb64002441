"""The package for pages: it is built, which checks its types, and its own tests pass."""

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
    """The file that `npm pack` makes."""
    return packed(tmp_path_factory.mktemp("packed"))


def npm(*command):
    """What npm says; the test fails with it where it fails."""
    return output_of("npm", *command)


def output_of(*command):
    """What a command says in the folder of the package; a command that fails fails the test."""
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
