"""Round trips of small meshes."""

import numpy as np
import pytest

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.model.sequence import MeshSequence
from samples.meshes import irregular_sequence, kg_error_percent, waving_grid

DEFAULT_KG = 0.5
"""Upper limit, in percent, of errors of the default quality."""


def test_encoding_is_deterministic():
    assert encode(irregular_sequence()) == encode(irregular_sequence())


def test_static_sequence_round_trips():
    still = np.repeat(waving_grid(1).vertices, 50, axis=0)
    sequence = MeshSequence(still, waving_grid(1).faces)
    decoded = decode(encode(sequence))
    assert kg_error_percent(still, decoded.vertices) < DEFAULT_KG
    assert np.ptp(decoded.vertices, axis=0).max() < 1e-6
    assert info(encode(sequence)).n_modes == (0,)  # one shape, on a grid
    assert info(encode(sequence, "pca-qp")).n_modes == (1,)


@pytest.mark.parametrize(("offset", "size"), [(1e6, 1.0), (0.0, 1e-6), (-3e7, 10.0)])
def test_error_is_invariant_to_translation_and_scale(offset, size):
    here = waving_grid(dtype=np.float64)
    there = MeshSequence(here.vertices * size + offset * size, here.faces)
    expected = kg_error_percent(here.vertices, decode(encode(here)).vertices)
    moved = kg_error_percent(there.vertices, decode(encode(there)).vertices)
    assert moved == pytest.approx(expected, rel=0.01)


def test_number_of_modes_is_the_requested_one():
    assert info(encode(waving_grid(12), "pca-qp", n_modes=3)).n_modes == (3,)


def test_short_last_block_has_as_many_modes_as_frames():
    data = encode(waving_grid(12), "pca-qp", n_modes=4, block_frames=5)
    assert info(data).n_modes == (4, 4, 2)


def test_number_of_modes_rises_with_the_requested_energy():
    sequence = waving_grid(12)
    counts = [
        info(encode(sequence, "pca-qp", energy=share)).n_modes[0]
        for share in (0.9, 0.999, 0.999999)
    ]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


def test_progress_ends_at_one():
    reported = []
    data = encode(waving_grid(), progress=lambda stage, share: reported.append((stage, share)))
    decode(data, progress=lambda stage, share: reported.append((stage, share)))
    assert reported[-1] == ("decoding", 1.0)
    assert all(0 <= share <= 1 for _, share in reported)
