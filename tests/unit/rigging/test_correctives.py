import numpy as np

from meshreel.rigging.correctives import CorrectiveSearch
from samples.rigs import turn


def search(rank=3, n_frames=20, n_verts=30):
    rng = np.random.default_rng(7)
    fields = rng.normal(size=(rank, n_verts, 3))
    weights = rng.normal(size=(n_frames, rank))
    rotation = turn(1.0) @ turn(0.5, 0)
    blended = np.tile(rotation, (n_frames, n_verts, 1, 1)).astype(np.float32)
    residuals = np.einsum("ab,tk,kvb->tva", rotation, weights, fields).astype(np.float32)
    return CorrectiveSearch(residuals, blended, 1.0, 1e-4), residuals


def test_residual_of_few_modes_needs_as_many_targets():
    correctives, residuals = search()
    spread = float(np.sqrt(np.square(residuals).sum(axis=2).mean()))
    assert correctives.count_for(1e-6) == 3
    found, mean, _ = correctives.round(3, np.inf)
    assert found.targets.shape == (3, 30, 3)
    assert mean < 0.03 * spread


def test_further_rounds_reduce_the_largest_error():
    correctives, _ = search(rank=8)
    bound = 0.8 * correctives.round(4, np.inf)[2]
    largest = [correctives.round(4, bound)[2] for _ in range(8)]
    assert largest[-1] < largest[0]


def test_weights_can_be_made_nonnegative_without_changing_the_motion():
    correctives, _ = search()
    found, _, _ = correctives.round(3, np.inf)
    moved, positive = found.nonnegative()
    assert found.weights.min() < 0 <= positive.weights.min()
    before = np.tensordot(found.weights, found.targets / 127, 1)
    after = moved + np.tensordot(positive.weights, found.targets / 127, 1)
    np.testing.assert_allclose(after, before, atol=1e-5 * np.abs(before).max())
