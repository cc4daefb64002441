"""Search for fields within an error bound, in few texels."""

import numpy as np
import pytest

from meshreel.codec.subspace.pca import joint_trajectories
from meshreel.formats.vat.pca.repair import Residuals, repair
from meshreel.formats.vat.pca.search import fit_fields, fit_rms, quantize_fields
from meshreel.runtime.progress import silent


@pytest.fixture(scope="module")
def displacements():
    """Waves over a strip, and a bump of few vertices, of shape (T, 3 V)."""
    rng = np.random.default_rng(5)
    time, place = np.linspace(0, 1, 40)[:, None, None], np.linspace(0, 1, 90)[None, :, None]
    every = [
        0.5**k * np.sin(2 * np.pi * (k * time + (k + 1) * place + rng.random(3))) for k in range(12)
    ]
    bump = 0.3 * np.exp(-(((place - 0.5) / 0.02) ** 2)) * np.sin(40 * time) * np.ones(3)
    return (sum(every) + bump).reshape(40, -1).astype(np.float32)


@pytest.mark.parametrize("bound", [0.1, 0.01, 0.001])
def test_fields_meet_the_bound(displacements, bound):
    fields = fit_fields(displacements, bound, silent)
    assert Residuals.of(displacements, fields).error <= bound


@pytest.mark.parametrize("bound", [0.3, 0.1, 0.02])
def test_search_needs_fewer_texels_than_components_of_two_digits(displacements, bound):
    _, vectors = joint_trajectories(displacements[None], 40)

    def two_digit_fields(count):
        components = (vectors[:, :count].T @ displacements).astype(np.float32)
        weights = np.ones(90, np.float32)
        return quantize_fields(components, np.full(count, 2), displacements, weights)

    candidates = map(two_digit_fields, range(1, 20))
    plain = next(one for one in candidates if Residuals.of(displacements, one).error <= bound)
    assert fit_fields(displacements, bound, silent).n_texels < plain.n_texels


def test_motion_below_the_bound_needs_no_fields(displacements):
    assert fit_fields(displacements, 10.0, silent).n_texels == 0


def test_search_returns_none_for_a_bound_below_float32(displacements):
    assert fit_fields(displacements, 1e-9, silent) is None


def test_repair_changes_only_vertices_beyond_the_bound(displacements):
    _, vectors = joint_trajectories(displacements[None], 12)
    components = (vectors.T @ displacements).astype(np.float32)
    weights = np.ones(90, np.float32)
    fields = quantize_fields(components, np.full(12, 2), displacements, weights)
    residuals = Residuals.of(displacements, fields)
    bound = 0.9 * residuals.error
    repaired, failed = repair(fields, residuals, bound)
    after = Residuals.of(displacements, repaired).distances()
    was_within = residuals.distances() <= 0.99 * bound
    same = (repaired.integers == fields.integers).reshape(12, 90, 3).all(axis=(0, 2))
    assert same[was_within].all()
    assert (np.flatnonzero(after > bound) == failed).all()
    assert len(failed) < np.count_nonzero(residuals.distances() > bound)


def test_fit_rms_meets_the_root_mean_square_error(displacements):
    for error in (0.1, 0.01):
        vectors = Residuals.of(displacements, fit_rms(displacements, error)).vectors
        assert np.sqrt(np.square(vectors).sum(axis=2).mean()) <= 1.05 * error
