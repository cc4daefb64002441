"""Pipes and devices as inputs are rejected by name before they are opened."""

import os

import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.formats.inspection import inspect_source
from meshreel.formats.load import load
from meshreel.formats.options import Reading
from meshreel.formats.registry import FORMATS
from meshreel.operations.save import save
from samples.commands import run
from samples.meshes import quad_sheet
from samples.opening import open_source
from samples.waiting import time_limit

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")


@pytest.fixture(autouse=True)
def limited():
    """Fail instead of blocking if a test opens a pipe without a writer."""
    with time_limit(30, "a pipe to be refused"):
        yield


def pipe(folder, name):
    os.mkfifo(folder / name)
    return folder / name


def inspected(path):
    return inspect_source(path, Reading())


@pytest.mark.parametrize("extension", sorted(FORMATS))
def test_load_rejects_a_named_pipe_without_writer(tmp_path, extension):
    path = pipe(tmp_path, f"a{extension}")
    with pytest.raises(InvalidInputError, match=r"a\.\w+ is a pipe, but inputs must be files"):
        load(path)


@pytest.mark.parametrize(
    "read", [open_source, inspected, meshreel.open, meshreel.decode, meshreel.info, meshreel.encode]
)
def test_open_rejects_a_named_pipe(tmp_path, read):
    with pytest.raises(InvalidInputError, match=r"a\.reel is a pipe, but inputs must be files"):
        read(pipe(tmp_path, "a.reel"))


def test_load_rejects_a_pipe_among_frames_and_as_topology(tmp_path):
    [frame] = save(quad_sheet(1), tmp_path / "a.obj")
    cache, *_ = save(quad_sheet(2), tmp_path / "c.pc2")
    other = pipe(tmp_path, "b.obj")
    for source, options in (([frame, other], {}), (cache, {"topology": other})):
        with pytest.raises(InvalidInputError, match=r"b\.obj is a pipe"):
            load(source, **options)


def test_load_rejects_a_pipe_as_usd_layer(tmp_path):
    pytest.importorskip("pxr")
    pipe(tmp_path, "b.usda")
    (tmp_path / "a.usda").write_text("#usda 1.0\n(\nsubLayers = [@./b.usda@]\n)\n")
    with pytest.raises(InvalidInputError, match=r"b\.usda is a pipe"):
        load(tmp_path / "a.usda")


def test_decode_rejects_a_pipe_with_data():
    reading, writing = os.pipe()
    os.write(writing, b"\x89REEL")
    try:
        with pytest.raises(InvalidInputError, match=r"is a pipe, but inputs must be files"):
            meshreel.decode(f"/dev/fd/{reading}")
    finally:
        os.close(reading)
        os.close(writing)


def test_load_rejects_a_device(tmp_path):
    with pytest.raises(InvalidInputError, match="/dev/zero is a device"):
        load("/dev/zero")


@pytest.mark.parametrize(
    "words", [("info", "a.reel"), ("info", "a.obj"), ("decode", "a.reel", "-o", "b.npz")]
)
def test_cli_error_for_a_pipe_gives_the_remedy(tmp_path, words):
    pipe(tmp_path, words[1])
    done = run(*words, cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr == (
        f"meshreel: {words[1]} is a pipe, but inputs must be files; save the data to a file first\n"
    )
