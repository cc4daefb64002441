import numpy as np
import pytest
from scipy.sparse import csc_array, tril

from meshreel.paper.reconstruction.assembly_tree import elimination_of, fronts_of
from meshreel.paper.reconstruction.dissection import nested_dissection
from samples.systems import irregular_faces, system_of


@pytest.fixture(scope="module")
def planned():
    """The elimination of an irregular mesh, its fronts, and the matrix in that order."""
    laplacian, matrix = system_of(*irregular_faces())
    elimination = elimination_of(nested_dissection(matrix, laplacian, 12))
    ordered = matrix[elimination.order][:, elimination.order]
    lower = csc_array(tril(ordered, format="csc"))
    return elimination, fronts_of(lower, elimination.ends), ordered


def test_every_unknown_is_eliminated_once(planned):
    elimination, fronts, ordered = planned
    np.testing.assert_array_equal(np.sort(elimination.order), np.arange(ordered.shape[0]))
    covered = np.concatenate([np.arange(front.start, front.stop) for front in fronts])
    np.testing.assert_array_equal(covered, np.arange(ordered.shape[0]))


def test_fronts_hold_all_that_the_factor_holds(planned):
    _, fronts, ordered = planned
    factor = np.linalg.cholesky(ordered.toarray())
    for front in fronts:
        filled = np.flatnonzero(np.abs(factor[:, front.start : front.stop]).max(axis=1))
        assert set(filled[filled >= front.stop]) <= set(front.rows)


def test_children_come_before_their_parent_or_in_an_earlier_wave(planned):
    elimination, fronts, _ = planned
    done = set()
    for wave in elimination.waves():
        finished = set(done)
        for piece in wave:
            within = set()
            for number in piece:
                assert set(fronts[number].children) <= done | within
                within.add(number)
            finished |= within
        done = finished
    assert done == set(range(len(fronts)))


def test_every_front_but_roots_has_one_parent(planned):
    _, fronts, _ = planned
    children = [child for front in fronts for child in front.children]
    assert len(children) == len(set(children)) == sum(len(front.rows) > 0 for front in fronts)
