"""``-`` as standard input and standard output of commands."""

import io
import os
import subprocess
import sys
from unittest.mock import patch

import numpy as np
import pytest

import meshreel
from meshreel.formats.registry import extension_of_bytes
from samples.commands import assert_fails, run
from samples.materials import dressed_sheet
from samples.meshes import waving_grid

OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def folder(tmp_path):
    """A folder with one sequence as walk.npz and walk.reel."""
    meshreel.save(waving_grid(3), tmp_path / "walk.npz")
    (tmp_path / "walk.reel").write_bytes(meshreel.encode(waving_grid(3)))
    return tmp_path


def piped(words, data, cwd):
    """Run `meshreel` in a new process with bytes as standard input."""
    command = [sys.executable, "-m", "meshreel", *words.split()]
    return subprocess.run(command, input=data, capture_output=True, timeout=120, cwd=cwd)


def run_reading(words, data, cwd):
    """Run `meshreel` in this process with bytes as standard input."""
    with patch("sys.stdin", io.TextIOWrapper(io.BytesIO(data))):
        return run(*words.split(), cwd=cwd)


def test_a_pipeline_encodes_and_decodes(folder):
    data = (folder / "walk.npz").read_bytes()
    encoded = piped("encode - -o -", data, folder)
    assert encoded.stdout == meshreel.encode(waving_grid(3))
    assert encoded.stderr.startswith(b"stdout.reel\n")
    decoded = piped("decode - -o - --to npz", encoded.stdout, folder)
    assert decoded.stderr.startswith(b"stdout.npz\n")
    (folder / "decoded.npz").write_bytes(decoded.stdout)
    expected = meshreel.decode(encoded.stdout)
    np.testing.assert_array_equal(meshreel.load(folder / "decoded.npz").vertices, expected.vertices)
    assert {path.name for path in folder.iterdir()} == {"walk.npz", "walk.reel", "decoded.npz"}


def test_from_names_a_format_without_signature(folder):
    done = run_reading("info -", OBJ, folder)
    assert_fails(done, "b'v 0 0 0\\nv 1 ', do not identify its format; give it with --from")
    done = piped("convert - --from obj -o - --to ply", OBJ, folder)
    assert done.stdout.startswith(b"ply\n")
    done = run_reading("convert - --from OBJ -o a.off", OBJ, folder)
    assert meshreel.load(folder / "a.off").name == "a"


@pytest.mark.every_case
@pytest.mark.parametrize("extension", ["npz", "reel", "glb", "ply", "off"])
def test_first_bytes_identify_written_files(tmp_path, extension):
    path = tmp_path / f"a.{extension}"
    meshreel.save(waving_grid(1), path)
    assert extension_of_bytes(path.read_bytes()) == path.suffix


@pytest.mark.every_case
@pytest.mark.parametrize("extension", ["usda", "usdc", "usdz", "abc"])
def test_first_bytes_identify_written_scenes(tmp_path, extension):
    pytest.importorskip("alembic3d" if extension == "abc" else "pxr")
    test_first_bytes_identify_written_files(tmp_path, extension)


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("head", "extension"),
    [
        (b"solid cube\n", ".stl"),
        (b"# vtk DataFile Version 3.0\n", ".vtk"),
        (b"POINTCACHE2\0\1\0\0\0", ".pc2"),
        (b"DRACO\2\2", ".drc"),
        (b"ply\r\nformat ascii 1.0", ".ply"),
        (b"PK\3\4" + bytes(26) + b"readme.txt\0", None),
        (b"\x89HDF\r\n\x1a\n", None),
        (OBJ, None),
    ],
)
def test_first_bytes_identify_formats_with_a_signature(head, extension):
    assert extension_of_bytes(head) == extension


def test_info_and_compare_read_standard_input(folder):
    stream = (folder / "walk.reel").read_bytes()
    done = run_reading("info -", stream, folder)
    assert done.stdout.startswith("stdin.reel\n")
    expected = run("info", "walk.reel", cwd=folder).stdout
    assert done.stdout.splitlines()[1:] == expected.splitlines()[1:]
    done = run_reading("compare walk.npz -", stream, folder)
    assert done.stdout.startswith("stdin.reel against walk.npz\n")
    done = run_reading("compare - walk.reel --json", (folder / "walk.npz").read_bytes(), folder)
    assert '"original": "stdin.npz"' in done.stdout


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("encode -", "standard input has no name; name the output with -o"),
        ("encode walk.npz -", "is one file, which cannot be repeated or be one of several frames"),
        ("compare - -", "is one file, which cannot be repeated or be one of several frames"),
        ("info walk.npz --from npz", "--from is the format of standard input (-); omit it"),
        ("decode walk.reel -o a.npz --to npz", "--to is the format of standard output (-o -)"),
        ("decode walk.reel -o -", "the format of standard output is unknown; give it with --to"),
        ("decode walk.reel -o - --to tif", "unknown file extension .tif; known are .obj, "),
        ("decode walk.reel -o - --to ply", "stdout.ply stores one frame, but there are 3"),
        ("decode walk.reel -o - --to pc2", "a .pc2 output would have further files (stdout.obj)"),
        ("decode walk.reel -", "the output is given with -o: meshreel decode walk.reel -o -"),
        ("encode walk.npz -o - --json", "--json prints on standard output, so it cannot be"),
        ("encode walk.npz -o - --force", "--force replaces files, so it cannot be combined"),
        ("encode walk.npz -o - --split", "--split writes several files, so it cannot be combined"),
        ("info -", "standard input is empty; pipe or redirect a file into it"),
        ("view -", "`meshreel view` needs files; - (standard input or output) is accepted by"),
    ],
)
def test_misused_standard_streams_are_errors_that_name_a_remedy(folder, words, message):
    done = run_reading(words, b"", folder)
    assert_fails(done, message)
    assert done.stdout == ""


def test_errors_of_contents_name_standard_input(folder):
    assert_fails(run_reading("info - --from obj", b"v 1 2 x\n", folder), "stdin.obj: line 1: ")


def test_outputs_with_separate_images_are_refused(tmp_path):
    pytest.importorskip("pxr")
    meshreel.save(dressed_sheet(), tmp_path / "a.reel")
    done = run("convert", "a.reel", "-o", "-", "--to", "usda", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    last = done.stderr.splitlines()[-1]  # after the notes and the table
    assert "further files (stdout_textures), and standard output is one file" in last


def test_a_closed_pipe_ends_quietly_with_an_error_code(folder):
    n_verts = 60_000  # more bytes than a pipe holds
    vertices = np.random.default_rng(0).random((1, n_verts, 3)).astype(np.float32)
    large = meshreel.MeshSequence(vertices, np.arange(n_verts).reshape(-1, 3))
    meshreel.save(large, folder / "large.npz")
    words = "-m meshreel convert large.npz -o - --to npz"
    program = subprocess.Popen(
        [sys.executable, *words.split()],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=folder,
    )  # fmt: skip
    assert program.stdout.read(2) == b"PK"
    program.stdout.close()
    printed = program.stderr.read().decode().splitlines()
    program.stderr.close()
    assert program.wait(60) == 1
    assert printed[0] == "stdout.npz"
    assert all(line.startswith("  ") for line in printed[1:])  # a table, and no error


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
@pytest.mark.parametrize(
    ("words", "name"), [("encode walk.npz -o -", "output"), ("info -", "input")]
)
def test_terminals_are_refused(folder, words, name):
    outer, terminal = os.openpty()
    done = subprocess.run(
        [sys.executable, "-m", "meshreel", *words.split()],
        stdin=terminal, stdout=terminal, stderr=subprocess.PIPE, text=True, timeout=120, cwd=folder,
    )  # fmt: skip
    os.close(outer)
    os.close(terminal)
    assert_fails(done, f"standard {name} is a terminal; ")
