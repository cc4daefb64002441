from functools import partial

import numpy as np

from meshreel.formats.gltf import morphs
from meshreel.formats.gltf.morphs import (
    BYTE,
    SHORT,
    best_weights,
    project,
)

integer_targets = partial(morphs.integer_targets, is_compressed=False)

RNG = np.random.default_rng(5)


def fields(n_targets=6, size=900):
    return RNG.uniform(-1, 1, (n_targets, size)).astype(np.float32)


def test_integer_targets_are_int16_without_allowed_noise():
    assert integer_targets(fields(), np.ones(6), 0.0).levels.tolist() == [SHORT] * 6


def test_small_targets_are_int8_within_the_allowed_noise():
    max_weights = np.array([1.0, 1e-3, 0.5, 2e-3, 1e-3, 0.1])
    result = integer_targets(fields(), max_weights, 3.5e-4)
    assert result.levels.tolist() == [SHORT, BYTE, SHORT, BYTE, BYTE, SHORT]


def test_rounding_error_of_targets_stays_below_the_noise():
    exact, max_weights = 0.3 * fields(), np.full(6, 0.7)
    noise = 0.7 * 0.3 * 1.5 / BYTE
    result = integer_targets(exact.copy(), max_weights, noise)
    assert (result.levels == BYTE).any()
    largest = np.abs(exact).max(axis=1)
    errors = (result.values * largest[:, None] - exact) * max_weights[:, None]
    distances = np.linalg.norm(errors.sum(axis=0).reshape(-1, 3), axis=1)
    assert np.sqrt((distances**2).mean()) < noise


def test_integer_targets_of_a_zero_field_are_zero():
    result = integer_targets(np.zeros((2, 9), np.float32), np.ones(2), 0.1)
    assert not result.values.any()


def test_best_weights_recover_the_weights_of_frames():
    targets = integer_targets(fields(), np.ones(6), 0.0)
    weights = RNG.standard_normal((20, 6)).astype(np.float32)
    np.testing.assert_allclose(best_weights(targets, weights @ targets.values), weights, atol=1e-5)


def test_best_weights_are_finite_for_equal_targets():
    targets = integer_targets(np.ones((2, 30), np.float32), np.ones(2), 0.0)
    weights = best_weights(targets, np.full((4, 30), 3, np.float32))
    np.testing.assert_allclose(weights @ targets.values, 3, rtol=1e-5)


def test_project_multiplies_matrices_in_pieces():
    vectors, frames = RNG.random((5, 3), np.float32), RNG.random((5, 20_000), np.float32)
    np.testing.assert_allclose(project(vectors, frames), vectors.T @ frames, rtol=1e-5)
