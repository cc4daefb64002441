"""Real sequences come back bit for bit, in fewer bytes than general coders take."""

import lzma
import os
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.model.sequence import MeshSequence

pytestmark = pytest.mark.real

NAMES = ("samba", "cow", "dance", "horse_gallop", "chicken", "balloons", "bone", "cesium_man")


@pytest.mark.parametrize("name", NAMES)
def test_every_bit_of_a_real_sequence_comes_back(name):
    folder = os.environ.get("MESHREEL_DATA")
    if not folder:
        pytest.skip("MESHREEL_DATA names no folder of real sequences")
    whole = meshreel.load(Path(folder) / f"{name}.npz")
    for dtype in (np.float32, np.float64):
        vertices = whole.vertices[:20].astype(dtype)
        given = MeshSequence(vertices, whole.faces, whole.fps)
        data = meshreel.encode(given, lossless=True, block_frames=12)
        found = meshreel.decode(data)
        assert found.vertices.dtype == dtype
        assert found.vertices.tobytes() == vertices.tobytes()
        assert found.faces.tobytes() == given.faces.tobytes()
        assert len(data) < len(lzma.compress(vertices.tobytes(), preset=1))
