import numpy as np

from meshreel.entropy.passes import N_PASSES, plan_passes, signed_votes


def grid(side):
    """Neighbours on a triangulated square."""
    number = np.arange(side * side).reshape(side, side)
    pairs = [
        (number[1:], number[:-1]),
        (number[:, 1:], number[:, :-1]),
        (number[1:, 1:], number[:-1, :-1]),
    ]
    a, b = (np.concatenate([pair[k].ravel() for pair in pairs]) for k in (0, 1))
    targets, sources = np.concatenate([a, b]), np.concatenate([b, a])
    order = np.argsort(targets, kind="stable")
    counts = np.bincount(targets, minlength=side * side)
    return np.concatenate([[0], np.cumsum(counts)]), sources[order]


def test_passes_take_every_column_once_when_there_are_neighbours():
    plan = plan_passes(400, grid(20))
    columns = np.concatenate([step.columns for step in plan])
    assert sorted(columns) == list(range(400))
    assert 1 < len(plan) <= N_PASSES


def test_one_pass_takes_all_when_there_are_no_neighbours():
    (step,) = plan_passes(5, None)
    assert step.columns.tolist() == [0, 1, 2, 3, 4]
    assert step.n_near.tolist() == [0] * 5


def test_columns_of_a_pass_are_no_neighbours_when_it_is_not_the_last():
    indptr, indices = grid(20)
    for step in plan_passes(400, (indptr, indices))[: N_PASSES - 1]:
        near = np.concatenate([indices[indptr[i] : indptr[i + 1]] for i in step.columns])
        assert not np.isin(near, step.columns).any()


def test_most_neighbours_are_coded_before_when_the_mesh_is_regular():
    indptr, indices = grid(20)
    n_near = sum(int(step.n_near.sum()) for step in plan_passes(400, (indptr, indices)))
    assert n_near > 0.42 * len(indices)  # of a pair only one can come first: at most a half


def chain_of_two():
    first, second = plan_passes(2, (np.array([0, 1, 2]), np.array([1, 0])))
    return int(first.columns[0]), second


def test_magnitudes_near_are_those_of_coded_neighbours_when_summed():
    source, step = chain_of_two()
    magnitudes = np.zeros(2, np.int64)
    magnitudes[source] = 7
    assert step.magnitudes_near(magnitudes).tolist() == [7]


def test_votes_turn_round_when_neighbours_keep_disagreeing():
    source, step = chain_of_two()
    row = signed_votes(np.array([5, -5]))
    vote = np.zeros(2, np.int64)
    vote[source] = 1
    assert step.predict_signs(vote).tolist() == [1]
    step.learn(row)
    assert step.predict_signs(vote).tolist() == [1 - 4]
