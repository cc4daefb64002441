import numpy as np
import pytest

from meshreel.codec.subspace.pca import joint_trajectories
from meshreel.formats.gltf.morphs import BYTE, SHORT, fit_morphs, measure
from meshreel.model.flag import simulate_flag


@pytest.fixture(scope="module")
def flag():
    """A flag in the wind as displacements from its mean, in meters."""
    vertices = simulate_flag(60, n_rows=16, n_columns=16).vertices
    return (vertices - vertices.mean(axis=0)).transpose(0, 2, 1).reshape(60, -1)


def plain_error(frames, n_targets):
    """Return the largest error of the leading components alone."""
    _, basis = joint_trajectories(frames[None], n_targets)
    residuals = (frames - basis @ (basis.T @ frames)).reshape(len(frames), 3, -1)
    return np.linalg.norm(residuals, axis=1).max()


@pytest.mark.slow
@pytest.mark.parametrize("bound", [0.02, 0.003, 0.0003])
def test_fit_morphs_meets_the_bound(flag, bound):
    result = fit_morphs(flag, bound)
    decoded = result.weights.astype(np.float64) @ result.targets.values
    distances = np.linalg.norm((decoded - flag).reshape(len(flag), 3, -1), axis=1)
    assert distances.max() <= bound
    np.testing.assert_allclose(result.errors, distances.max(axis=1), atol=1e-6)


@pytest.mark.slow
def test_fit_morphs_needs_fewer_targets_than_components(flag):
    result = fit_morphs(flag, 0.005)
    assert plain_error(flag, len(result.targets)) > 1.5 * 0.005


def test_fit_morphs_needs_one_target_for_motion_of_rank_one():
    time = np.sin(np.arange(9.0))[:, None]
    frames = (time * np.random.default_rng(1).uniform(-1, 1, (1, 30))).astype(np.float32)
    result = fit_morphs(frames, 1e-4)
    assert (len(result.targets), result.error <= 1e-4) == (1, True)


def test_fit_morphs_returns_the_best_targets_if_integers_are_too_coarse(flag):
    result = fit_morphs(flag, 1e-7)
    assert 1e-7 < result.error < 1e-4


def test_fixed_number_of_morphs_has_a_fifth_less_error_than_components(flag):
    result = fit_morphs(flag, 0.0, 12)
    assert len(result.targets) == 12
    assert result.error < 0.8 * plain_error(flag, 12)


def test_fixed_number_of_morphs_returns_fewer_targets_if_these_are_exact(flag):
    assert len(fit_morphs(flag[:4], 0.0, 50).targets) <= 4


def test_targets_use_the_full_integer_range(flag):
    targets = fit_morphs(flag, 0.002).targets
    assert set(targets.levels) == {BYTE, SHORT}
    np.testing.assert_array_equal(np.abs(targets.integers).max(axis=1), targets.levels)


def test_measure_returns_the_errors_of_changed_weights(flag):
    result = fit_morphs(flag, 0.01)
    weights = result.weights.copy()
    weights[3] = 0
    errors = measure(result.targets, weights, flag).errors
    longest = np.linalg.norm(flag[3].reshape(3, -1), axis=0).max()
    assert errors[3] == pytest.approx(longest, rel=1e-6)
    others, before = np.delete(errors, 3), np.delete(result.errors, 3)
    np.testing.assert_allclose(others, before, rtol=1e-4, atol=1e-6 * longest)
