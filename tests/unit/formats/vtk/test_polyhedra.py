"""Polyhedra of VTK files, which are read as their surface."""

import numpy as np
import pytest

from conformance.sources import boxes
from meshreel import FormatError, load

pytest.importorskip("vtkmodules")
pytest.importorskip("h5py")
from vtkmodules.vtkIOHDF import vtkHDFWriter
from vtkmodules.vtkIOLegacy import vtkUnstructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

from samples.vtk import add_arrays, grid, write_mesh

POINTS, HEXAHEDRA = boxes(3, 1, 1)
SIDES = [[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]]
NOTE = "left out: the inside of 4 solid cells; cells of type 42 (polyhedron) cannot be stored"
WRITERS = {
    "a.vtu": vtkXMLUnstructuredGridWriter,
    "a.vtk": vtkUnstructuredGridWriter,
    "a.vtkhdf": vtkHDFWriter,
}


def faces_of(nodes, sides=SIDES):
    """Return the numbers of faces and corners, and the corners, of a polyhedron, such as a box."""
    corners = [[len(side), *(int(nodes[at]) for at in side)] for side in sides]
    return [len(sides), *(number for one in corners for number in one)]


@pytest.mark.parametrize("name", WRITERS)
def test_faces_that_solids_share_are_inner(tmp_path, name, notes):
    first, middle, last = HEXAHEDRA
    tip = faces_of(len(POINTS) + np.arange(4), [[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]])
    mesh = grid(
        np.concatenate([POINTS, [[9, 0, 0], [10, 0, 0], [9, 1, 0], [9, 0, 1]]]),
        [(42, tip), (42, faces_of(first)), (12, middle), (42, faces_of(last))],
    )
    add_arrays(mesh.GetCellData(), number=np.array([0.0, 0.5, 1.5, 2.5]))
    found = load(write_mesh(WRITERS[name](), mesh, tmp_path / name), notes=notes)
    corners = found.vertices[0].astype(float)[found.faces]
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(3 + 1 / 6)
    assert found.surface.n_faces(len(found.faces)) == 14 + 4
    assert found.n_verts == len(POINTS) + 4
    assert found.tracks["number"].domain == "face"
    numbers = [0.0] * 4 + [0.5] * 5 + [1.5] * 4 + [2.5] * 5
    assert found.tracks["number"].values.ravel().tolist() == numbers
    assert NOTE in notes


def piece(points, types, connectivity, offsets, **arrays):
    """Return a piece of a .vtu file."""
    arrays = {"connectivity": connectivity, "offsets": offsets, "types": types, **arrays}
    cells = "".join(
        f'<DataArray type="Int64" Name="{name}" format="ascii">{" ".join(map(str, values))}'
        "</DataArray>"
        for name, values in arrays.items()
    )
    return (
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(types)}"><Points><DataArray '
        f'type="Float64" NumberOfComponents="3" format="ascii">{" ".join(map(str, points.ravel()))}'
        f"</DataArray></Points><Cells>{cells}</Cells></Piece>"
    )


def write_pieces(path, *pieces):
    path.write_text(
        '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">'
        f"<UnstructuredGrid>{''.join(pieces)}</UnstructuredGrid></VTKFile>"
    )
    return path


BOX = POINTS[HEXAHEDRA[0]]


NODES = [*range(8)]


def test_pieces_with_polyhedra_are_joined(tmp_path):
    one, two = {"faces": faces_of(NODES)}, {"faces": faces_of(NODES) * 2}
    first = piece(BOX, [12, 42], NODES * 2, [8, 16], **one, faceoffsets=[-1, 31])
    second = piece(BOX + np.array([5, 0, 0]), [42], NODES, [8], **one, faceoffsets=[31])
    third = piece(BOX, [42, 42], NODES * 2, [8, 16], **two, faceoffsets=[31, 62])
    found = load(write_pieces(tmp_path / "a.vtu", first, second, third))
    # The two cells of the first piece share all faces, and so do those of the third.
    assert found.surface.n_faces(len(found.faces)) == 6
    np.testing.assert_array_equal(found.vertices[0], BOX + np.array([5, 0, 0]))


@pytest.mark.parametrize(
    ("faces", "ends", "message"),
    [
        (faces_of(NODES), [30], "it has 31 numbers; the file declares 30"),
        *((faces_of(NODES), [end], "faceoffsets must ascend, in steps of") for end in (-1, 0)),
        (faces_of(NODES), [31, 31], "it has 2 numbers; the file declares 1"),
        ([7, *faces_of(NODES)[1:]], [31], "a polyhedron has a face with fewer than three"),
        (faces_of(range(1, 9)), [31], "outside|8"),
    ],
)
@pytest.mark.parametrize("n_pieces", [1, 2])
def test_damaged_faces_are_an_error(tmp_path, faces, ends, message, n_pieces):
    one = piece(BOX, [42], NODES, [8], faces=faces, faceoffsets=ends)
    with pytest.raises(FormatError, match=message):
        load(write_pieces(tmp_path / "a.vtu", *[one] * n_pieces))


@pytest.mark.parametrize(
    ("damaged", "message"),
    [
        ({}, None),
        ({"polyhedron_to_faces": [0, 1, 2, 3, 4, 6]}, r"a polyhedron has a face outside 0\.\.5"),
        ({"face_offsets": [4, 8, 12, 16, 20, 25]}, "it has 24 numbers; the file declares 25"),
        ({"polyhedron_offsets": [6, 6]}, "it has 2 numbers; the file declares 1"),
        ({"face_connectivity": [0, 1, 9] * 8}, "9"),
    ],
)
def test_faces_in_arrays_of_their_own_are_read_or_an_error(tmp_path, damaged, message):
    arrays = {
        "face_connectivity": np.ravel(SIDES), "face_offsets": [4, 8, 12, 16, 20, 24],
        "polyhedron_to_faces": [0, 1, 2, 3, 4, 5], "polyhedron_offsets": [6],
    }  # fmt: skip
    path = write_pieces(tmp_path / "a.vtu", piece(BOX, [42], NODES, [8], **arrays | damaged))
    if message is None:
        assert load(path).surface.face_sizes.tolist() == [4] * 6
        return
    with pytest.raises(FormatError, match=message):
        load(path)


def test_quadratic_polygons_have_the_corners_that_are_first(tmp_path):
    mesh = grid(POINTS, [(36, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9])])
    found = load(write_mesh(vtkXMLUnstructuredGridWriter(), mesh, tmp_path / "a.vtu"))
    assert found.surface.face_sizes.tolist() == [5]
    assert found.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]


def test_cells_that_flat_meshes_cannot_hold_are_noted(tmp_path, notes):
    mesh = grid(POINTS, [(5, [0, 1, 2]), (3, [0, 1]), (22, [0, 1, 4, 2, 5, 6])])
    load(write_mesh(vtkXMLUnstructuredGridWriter(), mesh, tmp_path / "a.vtu"), notes=notes)
    assert notes == [
        "left out: cells that are points and lines",
        "flat cells with nodes in the middle of edges are read as their corners",
    ]
