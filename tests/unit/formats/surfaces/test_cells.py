"""Surfaces of cells, compared with the faces of VTK's cells and with a search over all pairs."""

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.surfaces.cells import CELL_FACES, SOLIDS, Cells, cell_mesh, extract_surface
from meshreel.kernel.cells import cell_sizes
from meshreel.model.cells import Cells as VolumeCells

KINDS = [kind for kind in CELL_FACES if kind < 60]  # VTK's cells of any order have no fixed nodes


def cells_of(kinds, nodes):
    counts = np.array([len(row) for row in nodes], np.int64)
    return Cells(np.array(kinds), counts, np.concatenate(nodes).astype(np.int64))


def polygons_of(surface, n_points):
    """Return the points of each polygon, from the lowest on."""
    points = np.arange(n_points)[surface.points][surface.corners]
    return [from_lowest(face) for face in np.split(points, np.cumsum(surface.counts)[:-1])]


def from_lowest(face):
    start = int(np.argmin(face))
    return (*map(int, face[start:]), *map(int, face[:start]))


@pytest.mark.every_case
@pytest.mark.parametrize("kind", KINDS)
def test_faces_and_solids_are_those_of_vtk(kind):
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    cell = model.vtkGenericCell.InstantiateCell(kind)
    n_points, is_solid = cell.GetNumberOfPoints(), cell.GetCellDimension() == 3
    for point in range(n_points):
        cell.GetPointIds().SetId(point, point)
    expected = set()
    for number in range(cell.GetNumberOfFaces() if is_solid else 1):
        part = cell.GetFace(number) if is_solid else cell
        points = [part.GetPointId(corner) for corner in range(part.GetNumberOfEdges())]
        if part.GetCellType() == 8:  # a pixel, whose points are in rows
            points[2:] = points[:1:-1]
        expected.add(from_lowest(points))
    found = extract_surface(cells_of([kind], [range(n_points)]), n_points)
    assert set(polygons_of(found, n_points)) == expected
    assert (kind in SOLIDS, found.n_solids) == (is_solid, is_solid)
    if kind < len(cell_sizes()) and cell_sizes()[kind]:
        assert VolumeCells(np.array([kind]), np.arange(n_points)).n_solids == is_solid
    n_used = 1 + max(max(face) for face in CELL_FACES[kind])
    with pytest.raises(FormatError, match=f"has {n_used - 1} points; it needs {n_used}"):
        extract_surface(cells_of([kind], [range(n_used - 1)]), n_points)


@pytest.mark.parametrize("first", [69, 76])  # Lagrange's and Bézier's
def test_cells_of_any_order_have_the_faces_of_their_corners(first):
    linear = [CELL_FACES[kind] for kind in (5, 9, 10, 12, 13, 14)]
    assert [CELL_FACES[kind] for kind in range(first, first + 6)] == linear


@pytest.mark.parametrize("n_faces", [[1, 4], [4], [4, 0, 0]])
def test_faces_of_cells_that_are_no_polyhedra_are_refused(n_faces):
    cells = cells_of([42, 10], [range(4), range(4)])
    faces = np.arange(4), np.full(4, 3), np.array([0, 1, 3, 1, 2, 3, 2, 0, 3, 0, 2, 1])
    assert cells.with_faces(np.array([4, 0]), *faces).counts.tolist() == [17, 4]
    with pytest.raises(FormatError, match=f"faces of {len(n_faces)} cells do not fit"):
        cells.with_faces(np.array(n_faces), *faces)


def test_cells_keep_their_places_where_points_are_left_out():
    points = np.random.default_rng(1).random((8, 3))
    cells = cells_of([10, 10], [[0, 1, 2, 3], [2, 3, 5, 6]])
    whole = cell_mesh(cells, 8)
    assert cell_mesh(Cells(**vars(cells)), 8) is whole is not cell_mesh(cells, 9)
    mesh = whole.without_points(np.isin(np.arange(8), [4, 7])).mesh(points)
    np.testing.assert_array_equal(mesh.vertices, np.delete(points, [4, 7], axis=0))
    np.testing.assert_array_equal(mesh.vertices[mesh.cells.nodes], points[cells.points])
    np.testing.assert_array_equal(mesh.vertices[mesh.corners], points[whole.corners])


@pytest.mark.parametrize("seed", range(5))
def test_surface_of_random_cells_is_that_of_a_search(seed):
    rng = np.random.default_rng(seed)
    kinds = rng.choice([5, 9, 10, 13, 14], 60).tolist()
    widths = {kind: 1 + max(max(face) for face in CELL_FACES[kind]) for kind in set(kinds)}
    nodes = [rng.choice(7, widths[kind], replace=False) for kind in kinds]
    faces = [
        (kind in SOLIDS, tuple(row[list(face)]))
        for kind, row in zip(kinds, nodes, strict=True)
        for face in CELL_FACES[kind]
    ]
    sides = [frozenset(face) for is_solid, face in faces if is_solid]
    expected = [
        from_lowest(face)
        for is_solid, face in faces
        if not is_solid or sides.count(frozenset(face)) == 1
    ]
    assert polygons_of(extract_surface(cells_of(kinds, nodes), 7), 7) == expected
