"""Disks that become full while a file is written: one line that names it, and nothing left."""

import subprocess
import sys

import pytest

import meshreel
from meshreel.formats.registry import FORMATS, SEQUENCE_FORMATS, is_written
from samples.commands import assert_fails
from samples.meshes import waving_grid

resource = pytest.importorskip("resource")

LIMITED = (
    "import resource, sys; limit = int(sys.argv.pop(1)); "
    "resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)); "
    "from meshreel.cli import main; main()"
)
"""The program, where no file may be larger; Python itself ignores the signal that comes of it."""

LARGE = (".npz", ".abc", ".usd", ".usda", ".usdc", ".usdz", ".pc2", ".mdd", ".h5", ".vtkhdf")
WRITTEN = [ending for ending, one in FORMATS.items() if is_written(one)]


@pytest.fixture(scope="module")
def reel(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "grid.reel"
    path.write_bytes(meshreel.encode(waving_grid(80)))
    return path


def limited(n_bytes, *arguments):
    """The finished process of `meshreel ARGUMENTS`, none of whose files grows larger."""
    return subprocess.run(
        [sys.executable, "-c", LIMITED, str(n_bytes), *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.parametrize(
    ("ending", "limit"),
    [
        *((ending, limit) for ending in WRITTEN for limit in (300, 1000)),
        *((ending, 20_000) for ending in WRITTEN if ending in LARGE),
    ],
)
def test_convert_names_the_file_and_leaves_none_when_it_grows_too_large(
    reel, tmp_path, ending, limit
):
    extra = getattr(FORMATS[ending], "extra", None)
    if extra is not None and not extra.is_installed:
        pytest.skip(f"{extra.library} is not installed")
    name = f"walk{ending}" if ending in SEQUENCE_FORMATS else f"walk_%d{ending}"
    done = limited(limit, "convert", reel, "-o", tmp_path / name)
    assert_fails(done, "walk")
    assert list(tmp_path.iterdir()) == []
