"""`--lossless` on the command line."""

import numpy as np
import pytest

import meshreel
from samples.commands import assert_fails, run, run_ok
from samples.meshes import waving_grid

GRID = waving_grid(8)
HEAT = np.random.default_rng(1).normal(300, 20, (8, GRID.n_verts)).astype(np.float32)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("lossless")
    tracks = {"heat": meshreel.Track(HEAT, unit="K")}
    sequence = meshreel.MeshSequence(GRID.vertices, GRID.faces, 25, tracks=tracks)
    meshreel.save(sequence, path / "walk.npz")
    (path / "walk.reel").write_bytes(meshreel.encode(sequence, lossless=True))
    return path


@pytest.fixture(autouse=True)
def _current_folder(folder, monkeypatch):
    monkeypatch.chdir(folder)


def output_of(*words):
    """Return the output of a command, without table borders."""
    return " ".join(run_ok(*words).stdout.split())


def assert_same_positions(sequence):
    assert sequence.vertices.dtype == GRID.vertices.dtype
    assert sequence.vertices.tobytes() == GRID.vertices.tobytes()
    np.testing.assert_array_equal(sequence.faces, GRID.faces)


@pytest.mark.parametrize("command", ["encode", "convert"])
def test_positions_round_trip_bit_for_bit_and_output_says_so(command):
    output = output_of(command, "walk.npz", "-o", f"{command}.reel", "--lossless")
    assert "method lossless rate" in output
    assert "positions exact 0 " in output
    assert "track heat exact, --lossless 0 " in output
    decoded = meshreel.decode(f"{command}.reel")
    assert_same_positions(decoded)
    assert decoded.tracks["heat"].values.tobytes() == HEAT.tobytes()


def test_info_shows_a_lossless_stream():
    output = output_of("info", "walk.reel")
    assert "method lossless" in output
    assert "lossless: positions are equal bit for bit" in output
    assert "heat: scalar of each vertex, float32 in K, exact" in output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["convert", "walk.npz", "-o", "a.reel", "--lossless", "--max-error", "1mm", "--unit=m"],
            "--max-error has no effect with --lossless; omit it",
        ),
        (
            ["convert", "walk.npz", "-o", "a.glb", "--lossless"],
            "--lossless applies to .reel outputs",
        ),
        (["decode", "walk.reel", "-o", "a.npz", "--modes", "2"], "lossless has no modes"),
    ],
)
def test_options_without_effect_are_rejected(words, message):
    assert_fails(run(*words), message)
