"""The coding, surface and graphs of cells, compared with the plain reader's."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from conformance.cells import CellReader, across_sides, links_of, surface_of
from conformance.sources import mixed_cells, of_type
from meshreel.errors import InvalidInputError
from meshreel.kernel.cells import cell_links, cell_sizes, cell_surface, encode_cells

TYPES = np.flatnonzero(cell_sizes())


def random_cells(seed):
    """Return cells between 40 vertices: tetrahedra, of one type, or of all types."""
    rng = np.random.default_rng(seed)
    kind = TYPES[seed // 3 % len(TYPES)]
    rows = rng.permuted(np.tile(np.arange(40), (9, 1)), axis=1)[:, : cell_sizes()[kind]]
    return (
        of_type(10, rng.permutation(Delaunay(rng.random((40, 3))).simplices)),
        of_type(kind, rows),
        mixed_cells(int(rng.integers(1, 40)), 40, seed),
    )[seed % 3]


def lines(links):
    """Return links as rows a, b, b, each once."""
    ends = {(min(link), max(link)) for link in links if link[0] != link[1]}
    return [[low, high, high] for low, high in sorted(ends)]


@pytest.mark.every_case
@pytest.mark.parametrize("seed", range(90))
def test_plain_reader_finds_the_same_cells_surface_and_graphs(seed):
    given = random_cells(seed)
    coded = encode_cells(given.types, given.nodes, 40, listed=seed % 2 == 0)
    cells = CellReader(coded.data, given.n_cells, len(given.nodes), 40).read()
    assert [cell.code for cell in cells] == coded.types.tolist()
    assert [node for cell in cells for node in cell.nodes] == coded.nodes.tolist()
    found = [array.tolist() for array in cell_surface(coded.types, coded.nodes, 40)]
    assert found == [[list(row) for row in surface_of(cells)[0]], *surface_of(cells)[1:]]
    for of_cells, expected in ((False, links_of(cells)), (True, across_sides(cells))):
        links = cell_links(coded.types, coded.nodes, 40, of_cells=of_cells)
        assert links.tolist() == lines(expected)


@pytest.mark.parametrize("last", [[-1], [7], [], [6, 6]])
def test_nodes_that_are_no_vertices_or_of_no_cell_are_refused(last):
    types, nodes = np.full(3, 10, np.uint8), np.int32([0, 1, 2, 3, 1, 2, 3, 4, 3, 4, 5, 6])
    assert len(cell_surface(types, nodes, 7).sizes) == 10
    with pytest.raises(InvalidInputError):
        cell_surface(types, np.append(nodes[:-1], np.int32(last)), 7)
