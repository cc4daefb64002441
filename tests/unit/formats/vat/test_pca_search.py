"""Fields within a bound, in few texels."""

import numpy as np
import pytest

from meshreel.codec.subspace.pca import joint_trajectories
from meshreel.formats.vat.pca.repair import Misses, repaired
from meshreel.formats.vat.pca.search import _rounded, fit_fields, fit_mean
from meshreel.runtime.progress import silent


@pytest.fixture(scope="module")
def moves():
    """Waves over a strip, some of them of few vertices only, of shape (T, 3 V)."""
    rng = np.random.default_rng(5)
    time, place = np.linspace(0, 1, 40)[:, None, None], np.linspace(0, 1, 90)[None, :, None]
    every = [
        0.5**k * np.sin(2 * np.pi * (k * time + (k + 1) * place + rng.random(3))) for k in range(12)
    ]
    bump = 0.3 * np.exp(-(((place - 0.5) / 0.02) ** 2)) * np.sin(40 * time) * np.ones(3)
    return (sum(every) + bump).reshape(40, -1).astype(np.float32)


@pytest.mark.parametrize("bound", [0.1, 0.01, 0.001])
def test_fields_keep_the_bound(moves, bound):
    fields = fit_fields(moves, bound, silent)
    assert Misses.of(moves, fields).error <= bound


@pytest.mark.parametrize("bound", [0.3, 0.1, 0.02])
def test_fields_take_fewer_texels_than_components_of_bytes_within_the_bound(moves, bound):
    _, vectors = joint_trajectories(moves[None], 40)

    def fields_of_bytes(count):
        components = (vectors[:, :count].T @ moves).astype(np.float32)
        return _rounded(components, np.full(count, 2), moves, np.ones(90, np.float32))

    every = map(fields_of_bytes, range(1, 20))
    plain = next(one for one in every if Misses.of(moves, one).error <= bound)
    assert fit_fields(moves, bound, silent).n_texels < plain.n_texels


def test_a_sequence_that_moves_less_than_the_bound_needs_no_fields(moves):
    assert fit_fields(moves, 10.0, silent).n_texels == 0


def test_no_fields_are_given_where_float32_is_too_coarse(moves):
    assert fit_fields(moves, 1e-9, silent) is None


def test_repair_brings_vertices_within_the_bound_by_their_own_integers_only(moves):
    _, vectors = joint_trajectories(moves[None], 12)
    components = (vectors.T @ moves).astype(np.float32)
    fields = _rounded(components, np.full(12, 2), moves, np.ones(90, np.float32))
    misses = Misses.of(moves, fields)
    bound = 0.9 * misses.error
    better, lost = repaired(fields, misses, bound)
    after = Misses.of(moves, better).distances()
    was_near = misses.distances() <= 0.99 * bound
    same = (better.integers == fields.integers).reshape(12, 90, 3).all(axis=(0, 2))
    assert same[was_near].all()
    assert (np.flatnonzero(after > bound) == lost).all()
    assert len(lost) < np.count_nonzero(misses.distances() > bound)


def test_mean_fields_keep_the_root_mean_square_error(moves):
    for error in (0.1, 0.01):
        vectors = Misses.of(moves, fit_mean(moves, error)).vectors
        assert np.sqrt(np.square(vectors).sum(axis=2).mean()) <= 1.05 * error
