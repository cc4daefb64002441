"""Output uses the singular for one item."""

import re

import numpy as np
import pytest

import meshreel
from samples.commands import run

NOUNS = "frames|vertices|faces|modes|files|targets|meshes"
PLURAL_OF_ONE = re.compile(rf"(?<![\d.,])1 [a-z ]*?({NOUNS})\b")


@pytest.fixture
def triangle(tmp_path):
    """A folder with one frame of a triangle in several formats."""
    sequence = meshreel.MeshSequence(np.eye(3, dtype=np.float32)[None], [[0, 1, 2]])
    meshreel.save(sequence, tmp_path / "one.npz")
    meshreel.save(sequence, tmp_path / "one.usda")
    (tmp_path / "one.reel").write_bytes(meshreel.encode(sequence))
    return tmp_path


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ("encode one.npz -o a.reel", "1 frame, 3 vertices, 1 face"),
        ("info one.npz", "1 frame, 3 vertices, 1 face"),
        ("info one.usda", "1 frame, 3 vertices, 1 face"),
        ("info one.reel", "1 frame, 3 vertices, 1 face"),
        ("decode one.reel -o b.glb", "1 frame, 3 vertices, 1 face"),
        ("decode one.reel -o b_%d.obj", "1 frame, 3 vertices, 1 face"),
        ("demo --frames 1 --out demo", "1 frame, 2704 vertices"),
        ("convert one.npz -o b.usda", "1 frame, 3 vertices, 1 face"),
    ],
)
def test_output_uses_the_singular_for_one_item(triangle, command, expected):
    done = run(*command.split(), cwd=triangle)
    assert expected in done.stdout
    assert not PLURAL_OF_ONE.search(done.stdout + done.stderr)
