"""Prediction by the core and by the plain reader."""

import numpy as np
import pytest

from conformance.points import weights_of
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.errors import InvalidInputError
from meshreel.kernel.predict import Choice, encode_values, kriging_weights
from samples.coded_fields import decode_values
from samples.meshes import irregular_sequence, waving_grid

PLAIN = Choice(first_shaped=1 << 30, gain=0.0, rate_weight=0.0)


def sample(sequence, size=7, n_modes=6, seed=3):
    mesh = FieldMesh(sequence.faces, sequence.n_verts, size).hierarchy
    rng = np.random.default_rng(seed)
    scales = np.geomspace(300, 1, n_modes)[:, None]
    return mesh, np.rint(rng.laplace(scale=scales, size=(n_modes, mesh.n_verts))).astype(np.int32)


def sample_values(sequence, size, n_modes=6, seed=2):
    """Return a hierarchy, and smooth values in steps."""
    mesh, _ = sample(sequence, size)
    steps = np.random.default_rng(seed).normal(size=(mesh.n_verts, n_modes))
    return mesh, 100 * steps.cumsum(axis=0)


def assert_predicted(mesh, residuals, values, n_learned, key=None):
    """Assert that these residuals, without a loss, are the encoding of these values."""
    chosen, coded = encode_values(mesh, values, PLAIN, n_learned, key)
    np.testing.assert_array_equal(chosen, residuals)
    np.testing.assert_array_equal(coded, values)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1, 7, 16])
@pytest.mark.parametrize("sequence", [waving_grid(1, 8, 9), irregular_sequence(1)])
def test_plain_reader_predicts_the_same_bits(sequence, size):
    mesh, residuals = sample(sequence, size)
    assert_predicted(mesh, residuals, decode_values(sequence, residuals, size, 4), 4)


@pytest.mark.slow
@pytest.mark.parametrize("n_learned", [0, 2, 9])
def test_plain_reader_predicts_the_same_bits_with_weights_of_a_key_block(n_learned):
    sequence = waving_grid(1, 8, 9)
    mesh, residuals = sample(sequence)
    key = decode_values(sequence, sample(sequence, seed=4)[1], 7, 9)
    expected = decode_values(sequence, residuals, 7, n_learned, key)
    assert_predicted(mesh, residuals, expected, n_learned, key)


@pytest.mark.parametrize("scale", [1.0, 1e4, 1e7])
@pytest.mark.parametrize("choice", [PLAIN, Choice(1, 0.6, 0.1)])
def test_encoder_and_decoder_predict_the_same_bits(scale, choice):
    sequence = irregular_sequence(1)
    mesh, _ = sample(sequence, 16)
    targets = scale * np.random.default_rng(2).normal(size=(mesh.n_verts, 9)).cumsum(axis=0)
    residuals, values = encode_values(mesh, targets, choice, 5)
    np.testing.assert_array_equal(decode_values(sequence, residuals, 16, 5), values)


def test_values_are_within_half_a_step_without_a_rate_weight():
    mesh, targets = sample_values(waving_grid(1, 20, 31), 16, 9)
    _, values = encode_values(mesh, targets, PLAIN, 5)
    assert np.abs(values - targets).max() <= 0.5 + 1e-9


def test_weights_stay_small_when_parts_separate():
    """For two initially equal parts, unexplained motion must not enlarge the weights."""
    mesh, _ = sample(irregular_sequence(1), 16)
    targets = np.random.default_rng(5).normal(size=(mesh.n_verts, 8)) * 10.0 ** np.arange(8, 0, -1)
    residuals, _ = encode_values(mesh, targets, PLAIN, 8)
    assert np.abs(residuals).max() < 100 * np.abs(targets).max()


def test_values_do_not_depend_on_the_split_of_a_level(monkeypatch):
    mesh, targets = sample_values(waving_grid(1, 20, 31), 16)
    residuals, whole = encode_values(mesh, targets, PLAIN, 5)
    monkeypatch.setattr("meshreel.kernel.predict.CHUNK_VERTICES", 32)
    assert_predicted(mesh, residuals, whole, 5)


@pytest.mark.slow
@pytest.mark.parametrize("n_modes", [1, 2, 5, 8, 9, 19, 40])
@pytest.mark.parametrize("n_learned", [0, 3, 16])
def test_plain_reader_predicts_the_same_bits_of_many_modes(n_modes, n_learned):
    sequence = irregular_sequence(1)
    mesh, residuals = sample(sequence, 16, n_modes)
    expected = decode_values(sequence, residuals, 16, n_learned)
    assert_predicted(mesh, residuals, expected, n_learned)


@pytest.mark.parametrize("value", [1e10, -1e10, np.nan, np.inf])
def test_error_is_raised_when_a_residual_is_too_large(value):
    mesh, _ = sample(waving_grid(1, 8, 9))
    targets = np.zeros((mesh.n_verts, 2))
    targets[40, 1] = value
    with pytest.raises(InvalidInputError, match="fields cannot be encoded"):
        encode_values(mesh, targets, PLAIN, 2)


POINTS = {
    "anywhere": lambda rng, n: rng.normal(size=(n, 3)),
    "far from 0": lambda rng, n: 1e9 + rng.normal(size=(n, 3)),
    "in a plane": lambda rng, n: rng.normal(size=(n, 3)) * (1, 1, 0),
    "on a line": lambda rng, n: np.outer(rng.normal(size=n), (1, 2, 3)),
    "twice": lambda rng, n: np.repeat(rng.normal(size=((n + 1) // 2, 3)), 2, axis=0)[:n],
    "at one point": lambda rng, n: np.full((n, 3), 0.25),
    "too far apart": lambda rng, n: 1e200 * rng.normal(size=(n, 3)),
}


@pytest.mark.parametrize("size", [1, 7, 16])
@pytest.mark.parametrize("points", POINTS.values(), ids=POINTS)
def test_plain_reader_finds_the_same_weights_from_points(points, size):
    mesh, _ = sample(waving_grid(1, 8, 9), size)
    places = points(np.random.default_rng(size), mesh.n_verts)
    weights = kriging_weights(mesh, places, 0.03125)
    assert np.isfinite(weights).all()
    for vertex, stencil in enumerate(mesh.stencil):
        near = places[stencil[stencil >= 0]].tolist()
        expected = weights_of(places[vertex].tolist(), near, 0.03125) if near else []
        padded = np.zeros(size, np.float32)
        padded[: len(near)] = expected
        np.testing.assert_array_equal(weights[vertex], padded)


def test_weights_from_points_predict_linear_fields():
    sequence = waving_grid(1, 20, 20)
    mesh, _ = sample(sequence, 16)
    points = sequence.vertices[0].astype(np.float64)[mesh.order]
    field = points @ (300.0, -200.0, 50.0)
    weights = kriging_weights(mesh, points, 0.03125)
    first = mesh.stencil[:, 0]
    offsets = field[mesh.stencil] - field[first][:, None]
    predicted = field[first] + (weights * offsets).sum(axis=1)
    is_full = mesh.stencil[:, -1] >= 0
    assert is_full.mean() > 0.3
    np.testing.assert_allclose(predicted[is_full], field[is_full], atol=1.0)
