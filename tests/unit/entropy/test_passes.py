import numpy as np

from meshreel.entropy.passes import (
    MAX_SIGNED,
    Neighbourhood,
    limited_signs,
    neighbourhoods,
    single_pass,
)
from samples.passes import as_pass, line_passes


def learn(near, *signed):
    """Update the agreement with one row."""
    column = np.array(signed)[:, None]
    near.learn(column, column.any(axis=1))


def test_one_pass_takes_every_column_when_there_are_no_neighbours():
    (only,) = single_pass(5)
    assert only.columns.tolist() == [0, 1, 2, 3, 4]
    near = Neighbourhood(only, 5)
    assert near.sum_near(np.full(5, 7)).tolist() == [0] * 5
    assert near.predict_signs(np.full(5, 2)).tolist() == [0] * 5


def test_passes_without_columns_are_left_out_when_the_rest_is_prepared():
    first, second = line_passes(6, 2)
    nothing = as_pass([], [])
    plan = neighbourhoods([nothing, first, nothing, second], 6)
    assert [near.columns.tolist() for near in plan] == [[0, 2, 4], [1, 3, 5]]


def test_values_near_are_those_of_the_neighbours_listed_when_summed():
    near = Neighbourhood(as_pass([3, 0], [[1, 2], [4]]), 5)
    assert near.sum_near(np.array([1, 10, 100, 1000, 10_000])).tolist() == [110, 10_000]


def test_a_neighbour_counts_twice_when_it_is_listed_twice():
    near = Neighbourhood(as_pass([0], [[1, 1]]), 2)
    assert near.sum_near(np.array([0, 7])).tolist() == [14]
    assert near.predict_signs(np.array([0, -1])).tolist() == [-2]


def test_neighbours_vote_for_their_own_sign_when_nothing_is_learned_yet():
    near = Neighbourhood(as_pass([2], [[0, 1]]), 3)
    assert near.predict_signs(np.array([2, -1, 0])).tolist() == [1]


def test_votes_turn_round_when_neighbours_keep_disagreeing():
    near = Neighbourhood(as_pass([1], [[0]]), 2)
    learn(near, *limited_signs(np.array([5, -5])))
    assert near.predict_signs(np.array([1, 0])).tolist() == [1 - 4]


def test_each_neighbour_is_learned_by_itself_when_they_differ():
    near = Neighbourhood(as_pass([2], [[0, 1]]), 3)
    learn(near, 2, -1, 2)
    assert near.predict_signs(np.array([1, 0, 0])).tolist() == [1 + 4]
    assert near.predict_signs(np.array([0, 1, 0])).tolist() == [1 - 2]


def test_sums_and_the_pass_stay_the_same_when_signs_are_learned():
    given = as_pass([1, 2], [[0], [0]])
    near = Neighbourhood(given, 3)
    learn(near, 2, 2, -2)
    assert near.sum_near(np.array([3, 0, 0])).tolist() == [3, 3]
    assert given.indices.tolist() == [0, 0]
    assert given.indptr.tolist() == [0, 1, 2]


def test_votes_have_an_end_when_values_are_large():
    values = np.array([-(2**31) + 1, -1, 0, 1, 2**31 - 1])
    assert limited_signs(values).tolist() == [-MAX_SIGNED, -1, 0, 1, MAX_SIGNED]
