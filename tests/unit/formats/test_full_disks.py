"""A disk that becomes full during writing: one error line that names the file, no partial file."""

import sys
from pathlib import Path

import pytest

import meshreel
from meshreel.formats.registry import (
    FOLDER_FORMATS,
    FORMATS,
    FRAME_FORMATS,
    is_written,
    output_format_of,
)
from samples.commands import assert_fails, run
from samples.costs import slow_but
from samples.meshes import waving_grid

resource = pytest.importorskip("resource")

LARGE = (
    ".vat",
    ".npz",
    ".abc",
    ".usd",
    ".usda",
    ".usdc",
    ".usdz",
    ".pc2",
    ".mdd",
    ".h5",
    ".vtkhdf",
)
WRITTEN = [*(extension for extension, one in FORMATS.items() if is_written(one)), *FOLDER_FORMATS]


@pytest.fixture(scope="module")
def reel(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "grid.reel"
    path.write_bytes(meshreel.encode(waving_grid(80)))
    return path


@pytest.fixture
def limited(monkeypatch):
    """Run `meshreel ARGUMENTS` with a limit on file sizes.

    Python ignores the resulting signal.
    """
    # Otherwise cached bytecode would be truncated at the limit.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def limited_run(limit, *arguments):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
        try:
            return run(*arguments)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return limited_run


@pytest.mark.parametrize(
    ("extension", "limit"),
    slow_but(
        [(".obj", 1000), (".npz", 20_000)],
        [
            *((extension, limit) for extension in WRITTEN for limit in (300, 900)),
            *((extension, 20_000) for extension in WRITTEN if extension in LARGE),
        ],
    ),
)
def test_full_disk_error_names_the_file_and_leaves_none(limited, reel, tmp_path, extension, limit):
    extra = getattr(output_format_of(Path(f"walk{extension}")), "extra", None)
    if extra is not None and not extra.is_installed:
        pytest.skip(f"{extra.library} is not installed")
    name = f"walk_%d{extension}" if extension in FRAME_FORMATS else f"walk{extension}"
    done = limited(limit, "convert", reel, "-o", tmp_path / name)
    assert_fails(done, "walk")
    assert list(tmp_path.iterdir()) == []
