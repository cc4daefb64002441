"""The npm package builds with type checks, and its tests pass."""

import re
from pathlib import Path

import pytest

from samples.npm_projects import packed
from samples.programs import output_of
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


def output_in_package(*command):
    return output_of(*command, cwd=PACKAGE, timeout_s=TIME_LIMIT_S)


def test_package_has_scripts_and_types_when_built(built):
    for name in ("index.js", "three.js", "player.js", "index.d.ts", "three/index.d.ts"):
        assert (built / name).is_file(), name


@pytest.mark.parametrize(
    "check", [("publint", "--strict"), ("attw", "--profile", "esm-only")], ids=["publint", "attw"]
)
def test_published_package_resolves_when_bundlers_and_node_import_it(tarball, check):
    tool, *options = check
    output_in_package(PACKAGE / "node_modules" / ".bin" / tool, tarball, *options)


def test_the_tests_of_the_package_pass(built):
    output = output_in_package("npm", "test")
    assert re.search(r"^. pass [1-9]", output, re.MULTILINE), output
    assert re.search(r"^. fail 0$", output, re.MULTILINE), output
