"""Disks that become full while a file is written: one line that names it, and nothing left."""

import json
import os
import subprocess
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
from samples.commands import assert_fails
from samples.costs import slow_but
from samples.meshes import waving_grid

resource = pytest.importorskip("resource")

FORKING = """
import importlib, json, os, pkgutil, resource, sys
import meshreel.cli.convert, meshreel.codec.decoder, meshreel.codec.encoder
import meshreel.formats, meshreel.reel.decoder
from meshreel.cli import main

for found in pkgutil.walk_packages(meshreel.formats.__path__, "meshreel.formats."):
    try:
        importlib.import_module(found.name)
    except ImportError:  # of a library that is not installed
        pass

for line in sys.stdin:
    limit, words = json.loads(line)
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.dup2(writing, 2)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.close(writing)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        sys.argv = ["meshreel", *words]
        main()
    os.close(writing)
    with open(reading, encoding="utf-8") as told:
        errors = told.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    print(json.dumps([code, errors]), flush=True)
"""
"""The program for each line that comes, in a process of its own, where no file may be larger than
the limit of the line; Python itself ignores the signal that comes of it. Imports are done once,
and nothing else, for a process that has threads must not be forked."""

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
WRITTEN = [*(ending for ending, one in FORMATS.items() if is_written(one)), *FOLDER_FORMATS]


@pytest.fixture(scope="module")
def reel(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "grid.reel"
    path.write_bytes(meshreel.encode(waving_grid(80)))
    return path


@pytest.fixture(scope="module")
def limited():
    """Runs `meshreel ARGUMENTS` where no file grows larger than a number of bytes."""
    command, pipe = [sys.executable, "-c", FORKING], subprocess.PIPE
    # Or a compiled module would be cut off at the limit, and stay so.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=environment) as process:

        def run(limit, *arguments):
            words = [str(one) for one in arguments]
            print(json.dumps([limit, words]), file=process.stdin, flush=True)
            code, errors = json.loads(process.stdout.readline())
            return subprocess.CompletedProcess(words, code, None, errors)

        yield run
        process.stdin.close()


@pytest.mark.parametrize(
    ("ending", "limit"),
    slow_but(
        [(".obj", 1000), (".npz", 20_000)],
        [
            *((ending, limit) for ending in WRITTEN for limit in (300, 1000)),
            *((ending, 20_000) for ending in WRITTEN if ending in LARGE),
        ],
    ),
)
def test_convert_names_the_file_and_leaves_none_when_it_grows_too_large(
    limited, reel, tmp_path, ending, limit
):
    extra = getattr(output_format_of(Path(f"walk{ending}")), "extra", None)
    if extra is not None and not extra.is_installed:
        pytest.skip(f"{extra.library} is not installed")
    name = f"walk_%d{ending}" if ending in FRAME_FORMATS else f"walk{ending}"
    done = limited(limit, "convert", reel, "-o", tmp_path / name)
    assert_fails(done, "walk")
    assert list(tmp_path.iterdir()) == []
