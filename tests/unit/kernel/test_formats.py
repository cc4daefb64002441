"""Comparison of the core with the plain reader, an independent implementation."""

import numpy as np
import pytest

from conformance.bits import BitStream, NamedBits, integers
from conformance.cells import Cell, read_order
from conformance.order import FaceOrder, neighbors_in_order, read_items
from conformance.patterns import read_patterns
from conformance.surface import AlongFaces
from meshreel.kernel.cells import cell_sizes, encode_cells, encode_cells_order
from meshreel.kernel.integers import encode_integers
from meshreel.kernel.order import encode_order, opposite_sides
from meshreel.kernel.patterns import encode_patterns, face_predictors
from samples.meshes import grid_faces, octahedron_faces


def test_plain_reader_decodes_the_same_integers():
    rng = np.random.default_rng(3)
    rows = [
        rng.integers(-(1 << 30), 1 << 30, 50),
        np.rint(rng.laplace(scale=np.repeat([1, 40, 3000], 60))).astype(int),
        np.zeros(300, int),
    ]
    assert integers(encode_integers(rows, [0, 1, 2]), [50, 180, 300]) == [
        row.tolist() for row in rows
    ]


def meshes():
    rng = np.random.default_rng(4)
    fan = np.array([[0, i, i + 1] for i in range(1, 30)])  # more than 16 neighbors
    grid = np.asarray(grid_faces(7, 8))
    random = rng.integers(0, 25, (40, 3))  # degenerate, duplicate, non-manifold
    return {"fan": fan, "grid": grid, "random": random, "octahedron": octahedron_faces()}


@pytest.mark.parametrize("name", meshes())
@pytest.mark.parametrize("is_mixed", [False, True])
def test_plain_reader_computes_the_same_orders(name, is_mixed):
    faces, rng = meshes()[name], np.random.default_rng(5)
    n_verts, n_faces = int(faces.max()) + 2, len(faces)
    corners, sequence = 3 * np.arange(n_faces) + 1, np.arange(n_verts)[::-1]
    if is_mixed:
        corners, sequence = rng.permutation(corners), rng.permutation(n_verts)
        corners += rng.integers(-1, 2, n_faces)
    alone = NamedBits(BitStream(encode_order(faces, None, sequence)))
    around = neighbors_in_order(n_verts, faces.tolist())
    assert read_items(alone, "vertices", n_verts, around) == sequence.tolist()
    twins = opposite_sides(faces, n_verts)
    both = NamedBits(BitStream(encode_order(faces, corners, sequence)))
    order = FaceOrder(both, n_faces, twins.tolist()).read()
    assert order == corners.tolist()
    listed = [[int(faces[c // 3, (c + k) % 3]) for k in range(3)] for c in order]
    names = list(dict.fromkeys(one for face in listed for one in face))
    names += [number for number in range(n_verts) if number not in names]
    renamed = [[names.index(one) for one in face] for face in listed]
    around = neighbors_in_order(n_verts, renamed)
    in_names = read_items(both, "vertices", n_verts, around)
    assert [names[one] for one in in_names] == sequence.tolist()


@pytest.mark.parametrize("seed", range(6))
def test_plain_reader_restores_the_same_order_of_cells(seed):
    rng = np.random.default_rng(seed)
    n_verts = int(rng.integers(30, 60))
    types = rng.choice([5, 9, 10, 12, 24, 25, 27], 25).astype(np.uint8)
    sizes = cell_sizes()[types]
    near = [rng.integers(n_verts) + rng.permutation(n)[:n] for n in sizes]
    coded = encode_cells(
        types, np.concatenate(near).astype(np.int32) % n_verts, n_verts, listed=False
    )
    of_cells = np.split(coded.nodes, np.cumsum(cell_sizes()[coded.types])[:-1])
    cells = [Cell(int(t), nodes.tolist()) for t, nodes in zip(coded.types, of_cells, strict=True)]
    listed, vertices = read_order(b"\3" + encode_cells_order(coded), cells, n_verts)
    np.testing.assert_array_equal(coded.given_cells[listed], np.arange(len(cells)))
    np.testing.assert_array_equal(coded.internal_to_given[vertices], np.arange(n_verts))


@pytest.mark.parametrize("name", meshes())
def test_plain_reader_decodes_the_same_numbers_of_faces(name):
    faces, rng = meshes()[name], np.random.default_rng(6)
    n_rows = int(faces.max()) + 3
    values = np.cumsum(rng.integers(-300, 900, (n_rows, 2)), axis=0).astype(np.int32)
    values[::5] = values[0]
    values[3] = np.iinfo(np.int32).min, np.iinfo(np.int32).max
    twins = opposite_sides(faces, n_rows)
    data = encode_patterns(values, face_predictors(faces, twins, n_rows))
    expected = AlongFaces(faces.tolist(), n_rows).traverse()
    decoded = b"".join(one for row in read_patterns(data, 2, "i", expected) for one in row)
    assert decoded == values.astype("<i4").tobytes()
