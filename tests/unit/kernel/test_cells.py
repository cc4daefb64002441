"""Graphs of the nodes and the cells of volume meshes."""

from itertools import chain, combinations

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.surfaces.cells import CELL_FACES
from meshreel.kernel.cells import cell_links, cell_surface

TETRAHEDRA = [[0, 1, 2, 3], [1, 2, 3, 4], [3, 4, 5, 6]]
EDGES = {pair for nodes in TETRAHEDRA for pair in combinations(nodes, 2)}


@pytest.mark.parametrize("kind", [10, 12, 13, 14, 15, 16])
def test_links_of_a_cell_are_the_edges_of_its_faces(kind):
    faces = CELL_FACES[kind]
    pairs = (zip(face, face[1:] + face[:1], strict=True) for face in faces)
    edges = {tuple(sorted(pair)) for pair in chain.from_iterable(pairs)}
    n_nodes = 1 + max(map(max, faces))
    links = cell_links(np.uint8([kind]), np.arange(n_nodes, dtype=np.int32), n_nodes)
    assert links.tolist() == [[low, high, high] for low, high in sorted(edges)]


@pytest.mark.parametrize(("of_cells", "pairs"), [(False, EDGES), (True, {(0, 1)})])
def test_links_are_edges_of_nodes_or_pairs_of_cells_that_share_a_side(of_cells, pairs):
    types, nodes = np.full(3, 10, np.uint8), np.array(TETRAHEDRA, np.int32).ravel()
    links = cell_links(types, nodes, 7, of_cells=of_cells)
    assert links.tolist() == [[low, high, high] for low, high in sorted(pairs)]


@pytest.mark.parametrize("last", [[-1], [7], [], [6, 6]])
def test_nodes_that_are_no_vertices_or_of_no_cell_are_refused(last):
    types, nodes = np.full(3, 10, np.uint8), np.array(TETRAHEDRA, np.int32).ravel()
    assert len(cell_surface(types, nodes, 7).sizes) == 10
    with pytest.raises(InvalidInputError):
        cell_surface(types, np.append(nodes[:-1], np.int32(last)), 7)
