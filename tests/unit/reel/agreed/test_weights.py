from itertools import pairwise

import numpy as np
import pytest

from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.reel.agreed.weights import KNOWN_RIDGE, WeightLearner
from samples.meshes import grid_faces, octahedron_faces

ROWS, COLUMNS, SIZE = 24, 30, 10
Y, X = (axis.ravel() / 10.0 for axis in np.mgrid[0:ROWS, 0:COLUMNS])


def stencils_of(faces, n_verts, size=SIZE):
    """Of each resolution."""
    mesh = FieldMesh(faces.astype(np.int32), n_verts, size)
    ends = np.cumsum([len(resolution.predicted) for resolution in mesh.resolutions])
    return [mesh.stencils[start:end] for start, end in pairwise([0, *ends])]


GRID = stencils_of(grid_faces(ROWS, COLUMNS), ROWS * COLUMNS)
SMALL_ONES = stencils_of(
    np.concatenate([grid_faces(4, 5), octahedron_faces() + 20, [[26, 27, 28]]]), 31
)


def predicted(stencils, weights, fields):
    """Weighted means of the stencils, of shape (n, K)."""
    return np.einsum("ns,nsk->nk", weights, fields[stencils.stencil])


def errors(stencils, weights, fields):
    return np.abs(predicted(stencils, weights, fields) - fields[stencils.predicted])


def smooth_fields():
    """Four smooth fields that no weights of a few vertices reproduce together."""
    return np.stack([np.sin(2 * X + Y), np.cos(X - 2 * Y), X * Y, np.sin(X) * Y**2], axis=1)


def rough_fields(n_fields, n_verts):
    return np.random.default_rng(3).normal(size=(n_verts, n_fields))


def assert_sums(stencils, weights):
    is_empty = (stencils.stencil < 0).all(axis=1)
    np.testing.assert_allclose(weights[~is_empty].sum(axis=1), 1.0, atol=1e-10)
    assert not weights[is_empty].any()
    assert not weights[stencils.stencil < 0].any()


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("n_fields", [1, 3, 12])
@pytest.mark.parametrize("all_stencils", [GRID, SMALL_ONES])
def test_learned_weights_sum_to_one_when_a_stencil_names_any_vertex(all_stencils, n_fields, noise):
    n_verts = max(stencils.predicted.max() for stencils in all_stencils) + 1
    fields = rough_fields(n_fields, n_verts)
    for stencils in all_stencils:
        assert_sums(stencils, stencils.learn(fields, noise))


def test_stencils_of_the_coarsest_scale_have_no_weights_when_fields_are_known():
    coarsest = SMALL_ONES[0]
    assert not coarsest.weights.any()
    assert not coarsest.learn(rough_fields(2, 31), 0.1).any()


def test_penalty_is_one_for_the_nearest_and_grows_when_members_are_farther():
    for stencils in GRID[1:]:
        assert (stencils.penalty[:, 0] == 1).all()
        assert (np.diff(stencils.penalty, axis=1) >= 0).all()


def test_constant_fields_are_predicted_exactly_when_nothing_is_known():
    ones = np.ones((ROWS * COLUMNS, 1))
    for stencils in GRID[1:]:
        assert errors(stencils, stencils.weights, ones).max() < 1e-10


def test_known_fields_are_reproduced_when_a_stencil_can():
    """Three fields and a sum of one take four of ten weights; the ridge is a ten-thousandth."""
    fields = np.stack([X, Y, np.sin(2 * X + Y)], axis=1)
    stencils = GRID[-1]
    learned = errors(stencils, stencils.learn(fields, 0.0), fields)
    spread = np.abs(fields[stencils.stencil[:, 0]] - fields[stencils.predicted])
    assert learned.mean() < 0.01 * spread.mean()


def test_fields_that_vary_as_known_ones_do_are_predicted_well_when_the_sampling_is_uneven():
    """The point of learning: connectivity does not tell where vertices lie, known fields do."""
    rng = np.random.default_rng(5)
    x, y = X + 0.04 * rng.normal(size=X.shape), Y + 0.04 * rng.normal(size=Y.shape)
    known = np.stack([x, y], axis=1)
    wanted = np.stack([3 * x - y, np.sin(x + y)], axis=1)
    stencils = GRID[-1]
    learned = errors(stencils, stencils.learn(known, 0.0), wanted).mean()
    assert learned < 0.1 * errors(stencils, stencils.weights, wanted).mean()


def test_learned_weights_are_a_minimum_when_they_are_moved_a_little():
    """No small step that keeps the sum of the weights makes what they minimise smaller."""
    fields, noise, stencils = smooth_fields(), 1e-3, GRID[-1]
    learned = stencils.learn(fields, noise)
    full = np.flatnonzero((stencils.stencil >= 0).all(axis=1))[::40]
    for row in full:
        offsets = fields[stencils.stencil[row]] - fields[stencils.predicted[row]]
        values = [objective(learned[row], offsets, stencils, row, noise)]
        for one in range(SIZE):
            for shift in (-1e-4, 1e-4):
                moved = learned[row] + shift * (np.eye(SIZE)[one] - 1 / SIZE)
                values.append(objective(moved, offsets, stencils, row, noise))
        assert np.argmin(values) == 0


def objective(weights, offsets, stencils, row, noise):
    ridge = KNOWN_RIDGE * (offsets**2).sum() / SIZE + noise * offsets.shape[1]
    misfit = ((weights @ offsets) ** 2).sum()
    return misfit + ridge * (stencils.penalty[row] * (weights - stencils.weights[row]) ** 2).sum()


def test_learned_weights_are_those_of_smooth_fields_when_known_fields_do_not_vary():
    still = np.ones((ROWS * COLUMNS, 3)) * [1.0, -2.0, 5.0]
    for stencils in GRID[1:]:
        np.testing.assert_allclose(stencils.learn(still, 0.0), stencils.weights, atol=1e-10)


def test_learned_weights_are_those_of_smooth_fields_when_nothing_is_known():
    for stencils in GRID:
        nothing = np.zeros((ROWS * COLUMNS, 0))
        np.testing.assert_array_equal(stencils.learn(nothing, 0.5), stencils.weights)


def test_learned_weights_approach_those_of_smooth_fields_when_noise_outweighs_what_varies():
    fields, stencils = rough_fields(2, ROWS * COLUMNS), GRID[-1]
    away = [np.abs(stencils.learn(fields, noise) - stencils.weights).max() for noise in (0, 1, 1e6)]
    assert away[0] > away[1] > 1e3 * away[2]


def test_learned_weights_stay_the_same_when_fields_and_noise_are_scaled_together():
    stencils = GRID[-1]
    one = stencils.learn(smooth_fields(), 1e-4)
    other = stencils.learn(1000 * smooth_fields(), 1e-4 * 1e6)
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_learned_weights_stay_the_same_when_constants_are_added_to_fields():
    stencils = GRID[-1]
    one = stencils.learn(smooth_fields(), 1e-4)
    other = stencils.learn(smooth_fields() + np.array([1.0, -3.0, 0.0, 10.0]), 1e-4)
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_weights_are_the_same_when_vertices_are_taken_in_smaller_chunks(monkeypatch):
    faces, fields = grid_faces(ROWS, COLUMNS), smooth_fields()
    monkeypatch.setattr("meshreel.reel.agreed.weights.CHUNK_VERTICES", 7)
    for one, other in zip(GRID, stencils_of(faces, ROWS * COLUMNS), strict=True):
        np.testing.assert_allclose(other.learn(fields, 1e-3), one.learn(fields, 1e-3), atol=1e-9)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("cuts", [[2], [0, 2, 2, 7], [12]])
@pytest.mark.parametrize("all_stencils", [GRID, SMALL_ONES])
def test_learned_weights_are_the_same_when_fields_become_known_in_portions(
    all_stencils, cuts, noise
):
    n_verts = max(stencils.predicted.max() for stencils in all_stencils) + 1
    fields = rough_fields(12, n_verts)
    for stencils in all_stencils:
        learner = WeightLearner(stencils)
        for end, portion in zip([*cuts, 12], np.split(fields, cuts, axis=1), strict=True):
            learned = learner.learn(portion, noise)
            at_once = stencils.learn(fields[:, :end], noise)
            np.testing.assert_allclose(learned, at_once, rtol=0, atol=1e-9)


def test_weights_learned_before_stay_the_same_when_more_fields_become_known():
    stencils, fields = GRID[-1], smooth_fields()
    suggested = stencils.weights.copy()
    learner = WeightLearner(stencils)
    first = learner.learn(fields[:, :1], 1e-3)
    kept = first.copy()
    second = learner.learn(fields[:, 1:], 1e-3)
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(stencils.weights, suggested)
    assert np.abs(second - first).max() > 0.01


def test_noise_is_that_of_the_last_call_when_it_differs_between_portions():
    """The ridge is no sum over portions, as what is known of the fields is."""
    stencils, fields = GRID[-1], smooth_fields()
    learner = WeightLearner(stencils)
    learner.learn(fields[:, :2], 1e3)
    learned = learner.learn(fields[:, 2:], 1e-3)
    np.testing.assert_allclose(learned, stencils.learn(fields, 1e-3), rtol=0, atol=1e-9)
