import numpy as np
import pytest

from meshreel.codec.subspace.pca import joint_trajectories
from meshreel.formats.gltf.morphs import fit_given_morphs, fit_morphs, measure
from meshreel.formats.gltf.quantized import BYTE, SHORT
from meshreel.model.flag import simulate_flag


@pytest.fixture(scope="module")
def flag():
    """A flag in the wind as displacements from its mean, in metres."""
    vertices = simulate_flag(60, n_rows=16, n_columns=16).vertices
    return (vertices - vertices.mean(axis=0)).reshape(60, -1)


def plain_error(frames, n_targets):
    """The largest error of the leading components alone."""
    _, basis = joint_trajectories(frames[None], n_targets)
    misses = (frames - basis @ (basis.T @ frames)).reshape(len(frames), -1, 3)
    return np.linalg.norm(misses, axis=2).max()


@pytest.mark.parametrize("bound", [0.02, 0.003, 0.0003])
def test_fit_morphs_keeps_the_bound_when_it_is_measured_anew(flag, bound):
    found = fit_morphs(flag, bound)
    made = found.weights.astype(np.float64) @ found.targets.values
    distances = np.linalg.norm((made - flag).reshape(len(flag), -1, 3), axis=2)
    assert distances.max() <= bound
    np.testing.assert_allclose(found.errors, distances.max(axis=1), atol=1e-6)


def test_fit_morphs_takes_fewer_targets_than_components_when_few_vertices_are_far_off(flag):
    found = fit_morphs(flag, 0.005)
    assert plain_error(flag, len(found.targets)) > 1.5 * 0.005


def test_fit_morphs_takes_one_target_when_all_motion_is_one():
    time = np.sin(np.arange(9.0))[:, None]
    frames = (time * np.random.default_rng(1).uniform(-1, 1, (1, 30))).astype(np.float32)
    found = fit_morphs(frames, 1e-4)
    assert (len(found.targets), found.error <= 1e-4) == (1, True)


def test_fit_morphs_gives_the_best_it_can_when_integers_are_too_coarse(flag):
    found = fit_morphs(flag, 1e-7)
    assert 1e-7 < found.error < 1e-4


def test_fit_given_morphs_has_a_fifth_less_error_than_the_components_when_asked_for_the_least(flag):
    found = fit_given_morphs(flag, 12, 0.0)
    assert len(found.targets) == 12
    assert found.error < 0.8 * plain_error(flag, 12)


def test_fit_given_morphs_takes_fewer_targets_when_there_is_nothing_more_to_say(flag):
    assert len(fit_given_morphs(flag[:4], 50, 0.0).targets) <= 4


def test_targets_reach_the_largest_integer_when_they_are_made(flag):
    targets = fit_morphs(flag, 0.002).targets
    assert set(targets.levels) == {BYTE, SHORT}
    np.testing.assert_array_equal(np.abs(targets.integers).max(axis=1), targets.levels)


def test_measure_finds_the_errors_when_a_weight_is_changed(flag):
    found = fit_morphs(flag, 0.01)
    weights = found.weights.copy()
    weights[3] = 0
    errors = measure(found.targets, weights, flag).errors
    longest = np.linalg.norm(flag[3].reshape(-1, 3), axis=1).max()
    assert errors[3] == pytest.approx(longest, rel=1e-6)
    others, before = np.delete(errors, 3), np.delete(found.errors, 3)
    np.testing.assert_allclose(others, before, rtol=1e-4, atol=1e-6 * longest)
