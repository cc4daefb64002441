"""Decoding with a limited number of modes."""

import numpy as np
import pytest

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.errors import InvalidInputError
from samples.meshes import irregular_sequence, kg_error_percent, waving_grid
from samples.orders import shuffled

AT_REST = 16
"""Number of modes whose means over a block every preview contains."""

SEQUENCES = {"grid": waving_grid(20, dtype=np.float64), "irregular": irregular_sequence(20)}


@pytest.fixture(params=SEQUENCES)
def sequence(request):
    return SEQUENCES[request.param]


@pytest.mark.parametrize("more", [0, 1, 10**9])
def test_all_modes_decode_the_whole_stream(sequence, more):
    data = encode(sequence, step=3e-4)
    (n_modes,) = info(data).n_modes
    assert n_modes > 4
    whole, result = decode(data), decode(data, n_modes=n_modes + more)
    np.testing.assert_array_equal(result.vertices, whole.vertices)
    np.testing.assert_array_equal(result.faces, whole.faces)
    assert (result.fps, result.name) == (whole.fps, whole.name)


def test_error_falls_with_every_mode(sequence):
    data = encode(sequence, step=1e-6)
    (n_modes,) = info(data).n_modes
    errors = [
        kg_error_percent(sequence.vertices, decode(data, n_modes=count).vertices)
        for count in range(1, n_modes + 1)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 100 * errors[-1]


@pytest.mark.parametrize("n_modes", [1, 2, 3, 5])
def test_error_is_at_most_that_of_the_truncated_basis(sequence, n_modes):
    """The error is at most that of the leading singular vectors: means of others are kept."""
    data = encode(sequence, step=1e-6)
    decoded = decode(data, n_modes=n_modes).vertices
    low, high = (pick(sequence.vertices, axis=(0, 1)) for pick in (np.min, np.max))
    stacked = np.moveaxis(sequence.vertices - (low + high) / 2, 2, 0).reshape(-1, sequence.n_verts)
    left_out = np.linalg.svd(stacked, compute_uv=False)[n_modes:]
    least = np.linalg.norm(left_out)
    assert np.linalg.norm(decoded - sequence.vertices) <= least * (1 + 1e-2)


@pytest.mark.parametrize("n_modes", [1, 4])
@pytest.mark.parametrize("block_frames", [None, 8])
def test_mean_shape_of_a_block_does_not_depend_on_the_number_of_modes(
    sequence, block_frames, n_modes
):
    data = encode(sequence, step=1e-4, block_frames=block_frames)
    whole, strong, few = (decode(data, n_modes=n).vertices for n in (None, AT_REST, n_modes))
    for start in range(0, sequence.n_frames, block_frames or sequence.n_frames):
        frames = slice(start, start + block_frames if block_frames else None)
        mean = few[frames].mean(axis=0)
        np.testing.assert_allclose(mean, strong[frames].mean(axis=0), atol=1e-5)
        np.testing.assert_allclose(mean, whole[frames].mean(axis=0), atol=5e-3)


def test_one_mode_moves_with_rank_one_along_each_axis(sequence):
    decoded = decode(encode(sequence, step=1e-4), n_modes=1).vertices
    for axis in range(3):
        moved = decoded[:, :, axis] - decoded[:, :, axis].mean(axis=0)
        strengths = np.linalg.svd(moved, compute_uv=False)
        assert strengths[1] <= 1e-5 * max(strengths[0], 1)


@pytest.mark.parametrize("frames", [slice(0, 1), slice(3, 12), slice(-2, None)])
def test_range_of_frames_with_fewer_modes_equals_that_of_the_whole(sequence, frames):
    data = encode(sequence, step=1e-4, block_frames=8)
    np.testing.assert_allclose(
        decode(data, frames=frames, n_modes=2).vertices,
        decode(data, n_modes=2).vertices[frames],
        atol=1e-9,
    )


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_vertices_equal_those_of_the_whole_stream_in_every_order(order):
    sequence = shuffled(waving_grid(10, dtype=np.float64), 1)
    data = encode(sequence, step=1e-5, order=order)
    whole, coarse = decode(data), decode(data, n_modes=3)
    np.testing.assert_array_equal(coarse.faces, whole.faces)
    assert kg_error_percent(whole.vertices, coarse.vertices) < 15  # another order: above 100


def test_corrections_are_omitted_with_fewer_modes():
    sequence = irregular_sequence(20)
    data = encode(sequence, max_error=1.0)
    assert info(data).budget_bytes["corrections"] > 30
    (n_modes,) = info(data).n_modes
    whole, uncorrected = decode(data).vertices, decode(data, n_modes=n_modes).vertices
    diagonal = np.linalg.norm(np.ptp(sequence.vertices, axis=(0, 1)))
    errors, uncorrected_errors = (
        np.linalg.norm(found - sequence.vertices, axis=2) / diagonal
        for found in (whole, uncorrected)
    )
    is_moved = np.abs(whole - uncorrected).max(axis=2) > 1e-6 * diagonal
    assert errors.max() <= 0.01
    assert uncorrected_errors[is_moved].min() > 0.0099
    assert uncorrected_errors[~is_moved].max() <= 0.01


@pytest.mark.parametrize("n_modes", [0, -1, 2.5])
def test_decoding_refuses_an_invalid_number_of_modes(n_modes):
    with pytest.raises(InvalidInputError, match="n_modes must be a whole number of at least 1"):
        decode(encode(waving_grid(3)), n_modes=n_modes)


@pytest.mark.parametrize("name", ["lossless", "grid"])
def test_decoding_refuses_a_number_of_modes_for_methods_without_modes(name):
    data = encode(waving_grid(3), name, max_error=0.1 if name == "grid" else None)
    with pytest.raises(InvalidInputError, match=f"method {name} has no modes; omit n_modes"):
        decode(data, n_modes=2)
