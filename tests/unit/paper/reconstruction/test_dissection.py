import numpy as np
import pytest
from scipy.sparse import csc_array, csr_array, eye_array

from meshreel.paper.reconstruction.dissection import nested_dissection
from samples.meshes import grid_faces
from samples.systems import irregular_faces, system_of


def unrelated_couplings(matrix, nodes):
    """How many pairs are coupled of which neither's node is above the other's."""
    rows, columns = matrix.nonzero()
    low = np.minimum(nodes[rows], nodes[columns])
    high = np.maximum(nodes[rows], nodes[columns])
    levels = np.floor(np.log2(high)).astype(int) - np.floor(np.log2(low)).astype(int)
    return int(np.sum(high >> levels != low))


@pytest.mark.parametrize("part_size", [1, 7, 100])
def test_only_ancestors_are_coupled_when_the_mesh_is_irregular(part_size):
    laplacian, matrix = system_of(*irregular_faces())
    nodes = nested_dissection(matrix, laplacian, part_size)
    assert nodes.min() == 1
    assert unrelated_couplings(matrix, nodes) == 0


@pytest.mark.parametrize("density", [0.0, 0.003])
def test_only_ancestors_are_coupled_when_the_graph_is_another(density):
    _, matrix = system_of(*irregular_faces())
    noise = np.random.default_rng(1).random(matrix.shape) < density
    nodes = nested_dissection(matrix, csr_array((noise | noise.T).astype(float)), 50)
    assert unrelated_couplings(matrix, nodes) == 0


def test_parts_are_small_when_nothing_is_left_to_cut():
    laplacian, matrix = system_of(*irregular_faces())
    nodes = nested_dissection(matrix, laplacian, 40)
    counts = np.bincount(nodes)
    has_below = np.isin(np.arange(len(counts)), nodes // 2)
    assert counts[~has_below].max() <= 40


def test_neck_is_cut_first_when_it_joins_two_sheets():
    sheet = grid_faces(30, 30)
    faces = np.concatenate([sheet, sheet + 900, [[450, 451, 1300]]])
    laplacian, matrix = system_of(faces, 1800)
    nodes = nested_dissection(matrix, laplacian)
    assert np.sum(nodes == 1) < 20


def test_first_cut_is_two_rows_wide_when_the_mesh_is_a_long_grid():
    laplacian, matrix = system_of(grid_faces(20, 200), 4000)
    assert np.sum(nested_dissection(matrix, laplacian) == 1) <= 2 * 20


def test_nothing_separates_when_nothing_is_coupled():
    matrix = csc_array(eye_array(1000))
    nodes = nested_dissection(matrix, csr_array((1000, 1000)), 100)
    assert np.bincount(nodes).max() <= 100
