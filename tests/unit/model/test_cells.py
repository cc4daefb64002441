"""Cells: validation, surface, and what sequences and files do with them."""

import numpy as np
import pytest

from conformance.sources import boxes, of_type, tetrahedra, waving
from meshreel import Cells, FormatError, InvalidInputError, MeshSequence, load, save

POINTS, HEXAHEDRA = boxes(3, 2, 2)
BLOCK = of_type(12, HEXAHEDRA)


def block(n_frames=3, **tracks):
    """Return a waving block of 12 hexahedra with 36 nodes."""
    return MeshSequence(waving(POINTS, n_frames), cells=BLOCK, tracks=tracks)


def arrays(types, nodes):
    """Return cells of lists."""
    return Cells(np.array(types, np.uint8), np.array(nodes, np.int32))


def volume(sequence):
    """Return the volume inside the triangles of the first frame, by the divergence theorem."""
    a, b, c = sequence.vertices[0].astype(np.float64)[sequence.faces].transpose(1, 0, 2)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize("cells", [BLOCK, of_type(10, tetrahedra(POINTS, HEXAHEDRA))])
def test_surface_of_solids_is_closed_and_faces_outward(cells):
    sequence = MeshSequence(POINTS[None], cells=cells)
    assert volume(sequence) == pytest.approx(12)
    n_sides = 2 * (6 + 6 + 4)
    assert len(sequence.faces) == 2 * n_sides
    assert sequence.surface.n_faces(len(sequence.faces)) == n_sides * (1 if cells is BLOCK else 2)


def test_points_and_lines_have_no_faces():
    with pytest.raises(InvalidInputError, match=r"2 cells without a surface"):
        MeshSequence(POINTS[None], cells=Cells([1, 3], [0, 0, 1]))


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        (Cells([12.0], [0]), "types of cells must be integers"),
        (Cells([12], [[0]]), "nodes of cells must be integers of shape"),
        (arrays([], []), "cells are 1 to"),
        (Cells([7], [0, 1, 2]), "cell 0 has the type 7, which is not supported"),
        (Cells([10, 300], [0, 1, 2, 3]), "cell 1 has the type 300"),
        (Cells([10], [0, 1, 2]), "imply 4 nodes; got 3"),
        (Cells([10], [0, 1, 2, 36]), r"vertices in 0\.\.35"),
        (Cells([10], [0, 1, 2, -1]), r"vertices in 0\.\.35"),
        ([[0, 1, 2, 3]], "must be meshreel.Cells; got list"),
    ],
)
def test_invalid_cells_are_rejected(cells, message):
    with pytest.raises(InvalidInputError, match=message):
        MeshSequence(POINTS[None], cells=cells)


def test_faces_other_than_the_surface_are_rejected():
    sequence = block()
    with pytest.raises(InvalidInputError, match="give either faces or cells"):
        MeshSequence(sequence.vertices, sequence.faces, cells=BLOCK)
    with pytest.raises(InvalidInputError, match="needs faces, or cells"):
        MeshSequence(sequence.vertices)
    tetrahedral = MeshSequence(POINTS[None], cells=of_type(10, tetrahedra(POINTS, HEXAHEDRA)))
    with pytest.raises(InvalidInputError, match="not the surface of the cells"):
        tetrahedral.replace(faces=tetrahedral.faces[::-1])


def test_values_belong_to_cells_before_faces():
    sequence = block(stress=np.zeros((3, 12)), heat=np.zeros((3, 36)), load=np.zeros((3, 32)))
    domains = {name: track.domain for name, track in sequence.tracks.items()}
    assert domains == {"stress": "cell", "heat": "vertex", "load": "face"}
    with pytest.raises(InvalidInputError, match="36 vertices, 32 faces, 128 corners and 12 cells"):
        block(wrong=np.zeros((3, 13)))


@pytest.mark.parametrize("extension", [".npz", ".h5", ".reel"])
def test_files_return_cells_and_their_values(tmp_path, extension):
    pytest.importorskip("h5py")
    path, sequence = tmp_path / f"a{extension}", block(stress=np.arange(36.0).reshape(3, 12))
    save(sequence, path)
    found = load(path)
    np.testing.assert_array_equal(found.surface.cells.types, BLOCK.types)
    np.testing.assert_array_equal(found.surface.cells.nodes, BLOCK.nodes)
    np.testing.assert_array_equal(found.faces, sequence.faces)
    assert found.tracks["stress"].domain == "cell"


@pytest.mark.parametrize("types", [12, [12] * 12])
def test_arrays_may_have_a_row_for_each_cell(tmp_path, types):
    np.savez(tmp_path / "a.npz", vertices=block().vertices, cells=HEXAHEDRA, cell_types=types)
    np.testing.assert_array_equal(load(tmp_path / "a.npz").surface.cells.nodes, BLOCK.nodes)


def test_cells_without_types_are_refused_with_advice(tmp_path):
    np.savez(tmp_path / "a.npz", vertices=block().vertices, cells=HEXAHEDRA)
    with pytest.raises(FormatError, match="add the VTK type of each cell"):
        load(tmp_path / "a.npz")


def test_cells_that_a_file_cannot_store_are_left_out(tmp_path):
    sequence = block(stress=np.zeros((3, 12)))
    save(sequence, tmp_path / "a_%d.obj")
    found = load(tmp_path / "a_*.obj")
    assert found.surface.cells is None
    assert (len(found.faces), list(found.tracks)) == (len(sequence.faces), [])
