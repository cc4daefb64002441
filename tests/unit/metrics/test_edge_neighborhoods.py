import numpy as np
import pytest

from meshreel.metrics.sted import EdgeNeighborhoods

# A path 0-1-2-3-4 with edges a, b, c, d and an isolated vertex 5.
# Edges that touch a vertex or its neighbors: 0: ab, 1: abc, 2: abcd, 3: bcd, 4: cd, 5: none.
PATH = EdgeNeighborhoods(np.array([[0, 1], [1, 2], [2, 3], [3, 4]]), 6)


def test_neighborhood_of_a_path_has_the_edges_of_the_ring():
    _, total = PATH.weighted_deviation(np.array([1.0, 10, 100, 1000]), np.zeros(4))
    assert total.tolist() == [11, 111, 1111, 1110, 1100, 0]


def test_neighborhood_counts_shared_edges_once():
    # Tetrahedron plus a tail 3-4: every vertex but 4 sees all 7 edges, 4 the 4 edges at 3 or 4.
    edges = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3], [3, 4]])
    _, total = EdgeNeighborhoods(edges, 5).weighted_deviation(np.ones(7), np.zeros(7))
    assert total.tolist() == [7, 7, 7, 7, 4]


def test_deviation_with_zero_weights_is_zero():
    deviation, total = PATH.weighted_deviation(np.zeros(4), np.array([1.0, 2, 3, 4]))
    assert not deviation.any()
    assert not total.any()


def test_deviation_is_precise_for_values_with_a_large_offset(rng):
    # Whole numbers up to 2^40 are exact; a formula of raw squares would lose all digits here.
    edges = np.unique(np.sort(rng.integers(0, 20, (60, 2)), axis=1), axis=0)
    edges = edges[edges[:, 0] != edges[:, 1]]
    neighborhoods = EdgeNeighborhoods(edges, 20)
    weights, values = rng.uniform(1, 2, len(edges)), rng.integers(0, 9, len(edges)).astype(float)
    near, _ = neighborhoods.weighted_deviation(weights, values)
    far, _ = neighborhoods.weighted_deviation(weights, values + 2.0**20)
    np.testing.assert_allclose(far, near, rtol=1e-9)


def test_deviation_around_a_hub_matches_lists_of_edges(rng):
    # A fan of 3000 triangles: every vertex sees every spoke, 9 million pairs if listed; vertex
    # v of the rim sees also the four rim edges from v - 2 to v + 2, and the hub sees all.
    rim = np.arange(1, 3001)
    edges = np.concatenate(
        [np.column_stack([0 * rim, rim]), np.column_stack([rim[:-1], rim[1:]]), [[1, 3000]]]
    )
    weights, values = rng.uniform(size=len(edges)), rng.normal(size=len(edges))
    deviation, _ = EdgeNeighborhoods(edges, 3001).weighted_deviation(weights, values)
    for vertex, seen in ((0, range(6000)), (10, [*range(3000), 3007, 3008, 3009, 3010])):
        mean = np.average(values[seen], weights=weights[seen])
        variance = np.average((values[seen] - mean) ** 2, weights=weights[seen])
        assert deviation[vertex] == pytest.approx(np.sqrt(variance), rel=1e-12)


def test_neighborhoods_without_edges_are_empty():
    empty = EdgeNeighborhoods(np.zeros((0, 2), np.int64), 3)
    deviation, total = empty.weighted_deviation(np.zeros(0), np.zeros(0))
    assert deviation.tolist() == total.tolist() == [0, 0, 0]
