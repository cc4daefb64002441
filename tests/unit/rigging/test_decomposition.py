import numpy as np
import pytest

from meshreel.rigging.decomposition import Decomposition, convex_weights, fit_rigid
from samples.rigs import bending_tube, turn


def moments_of(points, targets, weights):
    lifted = np.column_stack([points, np.ones(len(points))]) * weights[:, np.newaxis]
    return np.einsum("tva,vb->tab", targets, lifted), lifted.T @ lifted


def test_rigid_motion_is_found_exactly():
    rng = np.random.default_rng(1)
    points, weights = rng.normal(size=(20, 3)), rng.uniform(0.2, 1, 20)
    rotation, offset = turn(1.0) @ turn(-0.6, 0), rng.normal(size=3)
    targets = ((points @ rotation.T + offset) * weights[:, np.newaxis])[np.newaxis]
    moments, gram = moments_of(points, targets, weights)
    found = fit_rigid(moments, gram, np.eye(3, 4)[np.newaxis])
    np.testing.assert_allclose(found[0, :, :3], rotation, atol=1e-5)
    np.testing.assert_allclose(found[0, :, 3], offset, atol=1e-5)


def test_mirrored_points_get_a_rotation():
    points = np.random.default_rng(2).normal(size=(20, 3))
    targets = (points * [1, 1, -1])[np.newaxis]
    moments, gram = moments_of(points, targets, np.ones(20))
    found = fit_rigid(moments, gram, np.eye(3, 4)[np.newaxis])
    assert np.linalg.det(found[0, :, :3]) == pytest.approx(1)


def test_collinear_points_keep_the_free_rotation():
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]])
    former = np.column_stack([turn(0.5, 0), np.zeros(3)])[np.newaxis]
    moments, gram = moments_of(points, points[np.newaxis], np.ones(3))
    found = fit_rigid(moments, gram, former)
    np.testing.assert_allclose(found[0, :, :3], former[0, :, :3], atol=1e-3)


def test_weights_are_convex_and_few():
    rng = np.random.default_rng(3)
    places = rng.normal(size=(50, 9, 12))
    truth = np.zeros((50, 9))
    truth[:, [1, 4, 7]] = [0.5, 0.3, 0.2]
    target = np.einsum("vi,vid->vd", truth, places)
    gram = np.einsum("vid,vjd->vij", places, places)
    weights = convex_weights(gram, np.einsum("vid,vd->vi", places, target))
    np.testing.assert_allclose(weights, truth, atol=1e-4)
    matches = rng.normal(size=(50, 9))
    noisy = convex_weights(gram, matches)
    assert (noisy >= 0).all()
    assert (np.count_nonzero(noisy, axis=1) <= 4).all()
    np.testing.assert_allclose(noisy.sum(axis=1), 1)
    # At the minimum on the sum 1, the gradient is the same for all candidates that are left.
    gradients = np.einsum("vij,vj->vi", gram, noisy) - matches
    for gradient, own in zip(gradients, noisy > 0, strict=True):
        np.testing.assert_allclose(gradient[own], gradient[own][0], atol=1e-6)


def test_influences_that_hardly_count_are_left_out():
    gram = np.array([[[1.0, 0.999], [0.999, 1.0]]])
    matches = np.array([[0.9996, 0.9994]])
    assert np.count_nonzero(convex_weights(gram, matches)) == 2
    assert np.count_nonzero(convex_weights(gram, matches, cost=1e-3)) == 1


def test_rounds_reduce_the_error():
    vertices = bending_tube().vertices.astype(np.float64)
    frames = vertices.transpose(0, 2, 1).reshape(-1, vertices.shape[1])
    fit = Decomposition(frames, frames[:3].T, np.zeros(vertices.shape[1], np.int64))
    fit.add_bones(fit.component_seeds(1, 0.0))
    errors = []
    for _ in range(3):
        fit.round(fits_rest=False)
        errors.append(float(np.square(fit.residuals()).sum()))
        fit.add_bones(fit.seeds(fit.residuals(), 1))
    fit.round()
    errors.append(float(np.square(fit.residuals()).sum()))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.05 * errors[0]
