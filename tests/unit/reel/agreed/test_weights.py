import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebval
from scipy.special import ive

from meshreel.geometry.connectivity import adjacency_matrix
from meshreel.reel.agreed.hierarchy import build_hierarchy, scattered
from meshreel.reel.agreed.weights import (
    CHEBYSHEV_DEGREE,
    DIFFUSION_TIME,
    KNOWN_RIDGE,
    N_SMOOTH_FIELDS,
    SMOOTH_RIDGE,
    WeightLearner,
    joined_stencils,
    smooth_stencils,
)
from samples.meshes import grid_faces, octahedron_faces

ROWS, COLUMNS, SIZE = 24, 30, 10
Y, X = (axis.ravel() / 10.0 for axis in np.mgrid[0:ROWS, 0:COLUMNS])


def stencils_of(faces, n_verts, size=SIZE):
    resolutions = build_hierarchy(adjacency_matrix(faces, n_verts), size)
    return [smooth_stencils(resolution) for resolution in resolutions]


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


@pytest.mark.parametrize("all_stencils", [GRID, SMALL_ONES])
def test_smooth_weights_sum_to_one_when_a_stencil_names_any_vertex(all_stencils):
    for stencils in all_stencils:
        assert_sums(stencils, stencils.weights)


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
    assert coarsest.weights.shape == (len(coarsest.predicted), 0)
    assert coarsest.learn(rough_fields(2, 31), 0.1).shape == (len(coarsest.predicted), 0)


def test_penalty_is_one_for_the_nearest_and_grows_when_members_are_farther():
    for stencils in GRID[1:]:
        assert (stencils.penalty[:, 0] == 1).all()
        assert (np.diff(stencils.penalty, axis=1) >= 0).all()


def test_smooth_weights_predict_far_better_when_compared_with_those_by_distance():
    """Of a sheet, in the finest resolution: its bends count, not only what is near."""
    fields, stencils = smooth_fields(), GRID[-1]
    inside = (stencils.stencil >= 0).all(axis=1)
    by_distance = 1.0 / stencils.penalty
    by_distance /= by_distance.sum(axis=1, keepdims=True)
    smooth = errors(stencils, stencils.weights, fields)[inside].mean()
    assert smooth < 0.5 * errors(stencils, by_distance, fields)[inside].mean()


def test_smooth_weights_predict_better_than_the_nearest_when_resolutions_are_coarse():
    for stencils in GRID[-3:-1]:
        assert len(stencils.predicted) > 20
        nearest = np.eye(1, SIZE)[[0] * len(stencils.predicted)]
        smooth = errors(stencils, stencils.weights, smooth_fields()).mean()
        assert smooth < 0.8 * errors(stencils, nearest, smooth_fields()).mean()


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
    for stencils in GRID:
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
        np.testing.assert_allclose(other.weights, one.weights, atol=1e-9)
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


@pytest.mark.parametrize("size", [SIZE, SIZE + 3])
@pytest.mark.parametrize("parts", [GRID, SMALL_ONES, SMALL_ONES[:1], GRID[-1:]])
def test_joined_stencils_are_those_of_the_parts_when_filled_up(parts, size):
    joined = joined_stencils(parts, size)
    ends = np.cumsum([len(part.predicted) for part in parts])[:-1]
    columns = (joined.predicted, joined.stencil, joined.penalty, joined.weights)
    for part, *found in zip(parts, *(np.split(column, ends) for column in columns), strict=True):
        width = part.stencil.shape[1]
        wanted = (part.stencil, part.penalty, part.weights)
        np.testing.assert_array_equal(found[0], part.predicted)
        for one, values, filling in zip(found[1:], wanted, (-1, 1.0, 0.0), strict=True):
            np.testing.assert_array_equal(one[:, :width], values)
            np.testing.assert_array_equal(
                one[:, width:], np.full((len(one), size - width), filling)
            )


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("n_fields", [0, 3])
@pytest.mark.parametrize("parts", [GRID, SMALL_ONES])
def test_joined_stencils_learn_the_weights_of_the_parts_when_filled_up(parts, n_fields, noise):
    n_verts = max(part.predicted.max() for part in parts) + 1
    fields = rough_fields(n_fields, n_verts)
    joined = joined_stencils(parts, SIZE + 2)
    learned = joined.learn(fields, noise)
    assert_sums(joined, learned)
    wanted = [part.learn(fields, noise) for part in parts]
    wanted = [np.pad(one, ((0, 0), (0, SIZE + 2 - one.shape[1]))) for one in wanted]
    np.testing.assert_allclose(learned, np.concatenate(wanted), rtol=0, atol=1e-9)


def smooth_fields_from_the_format(resolution):
    """The series of `docs/format.md`, with dense matrices; and what it is a series of."""
    near = resolution.adjacency.toarray() > 0
    mean = near / np.maximum(near.sum(axis=1, keepdims=True), 1)
    hashes = scattered(np.arange(len(near) * N_SMOOTH_FIELDS)).reshape(len(near), -1)
    signs = np.where(hashes >= np.uint64(2**63), 1.0, -1.0)
    coefficients = [ive(k, DIFFUSION_TIME) * (2 if k else 1) for k in range(CHEBYSHEV_DEGREE + 1)]
    values, vectors = np.linalg.eig(mean)
    series = chebval(values.real, coefficients)
    back = np.linalg.solve(vectors, signs)
    return [
        (vectors @ (factors[:, None] * back)).real
        for factors in (series, np.exp(-DIFFUSION_TIME * (1 - values.real)))
    ]


def weights_from_the_format(resolution, fields):
    """Each row by itself, by its normal equations with a multiplier for the sum."""
    result = np.zeros(resolution.stencil.shape)
    for row, (target, stencil) in enumerate(
        zip(resolution.predicted, resolution.stencil, strict=True)
    ):
        members = np.searchsorted(resolution.members, stencil[stencil >= 0])
        size = len(members)
        offsets = fields[members] - fields[np.searchsorted(resolution.members, target)]
        penalty = (resolution.hops[row, :size] / resolution.hops[row, 0]) ** 2
        ridge = SMOOTH_RIDGE * (offsets**2).sum() / size
        system = np.ones((size + 1, size + 1))
        system[:size, :size] = offsets @ offsets.T + np.diag(ridge * penalty)
        system[size, size] = 0
        result[row, :size] = np.linalg.solve(system, np.eye(size + 1)[size])[:size]
    return result


def test_smooth_weights_are_those_of_the_format_when_found_a_second_way():
    adjacency = adjacency_matrix(grid_faces(9, 7), 63)
    for resolution in build_hierarchy(adjacency, SIZE)[1:]:
        fields, diffused = smooth_fields_from_the_format(resolution)
        np.testing.assert_allclose(fields, diffused, atol=1e-2)
        wanted = weights_from_the_format(resolution, fields)
        np.testing.assert_allclose(smooth_stencils(resolution).weights, wanted, atol=1e-7)
