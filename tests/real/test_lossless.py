"""Real sequences round-trip bit for bit, in fewer bytes than with general compressors."""

import lzma

import numpy as np
import pytest

import meshreel
from meshreel.model.sequence import MeshSequence

pytestmark = pytest.mark.real

NAMES = ("samba", "cow", "dance", "horse_gallop", "chicken", "balloons", "bone", "cesium_man")


@pytest.mark.parametrize("name", NAMES)
def test_real_sequences_round_trip_bit_for_bit(sequence_named, name):
    whole = sequence_named(name, 20)
    for dtype in (np.float32, np.float64):
        vertices = whole.vertices.astype(dtype)
        original = MeshSequence(vertices, whole.faces, whole.fps)
        data = meshreel.encode(original, lossless=True, block_frames=12)
        decoded = meshreel.decode(data)
        assert decoded.vertices.dtype == dtype
        assert decoded.vertices.tobytes() == vertices.tobytes()
        assert decoded.faces.tobytes() == original.faces.tobytes()
        assert len(data) < len(lzma.compress(vertices.tobytes(), preset=1))
