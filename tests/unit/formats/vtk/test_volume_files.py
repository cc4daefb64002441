"""Volume cells written to VTK files, read back, and read by VTK's own readers."""

import numpy as np
import pytest

from conformance.sources import boxes, mixed_cells, of_type, waving
from meshreel import MeshSequence, Track, load, save

pytest.importorskip("vtkmodules")
pytest.importorskip("h5py")
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

from samples.vtk import add_arrays, grid, write_mesh

POINTS, HEXAHEDRA = boxes(3, 2, 2)
TIMES = [0.0, 0.1, 0.2, 0.25]
FILES = ("a_%d.vtu", "a.pvd", "a.vtkhdf")


def block():
    """Return a block of hexahedra with values of nodes and cells, at uneven times."""
    vertices = waving(POINTS, 4)
    tracks = {
        "heat": vertices[..., 0] + 300,
        "stress": Track(vertices[:, HEXAHEDRA].mean(axis=2), "cell", "vector"),
    }
    return MeshSequence(vertices, cells=of_type(12, HEXAHEDRA), times=TIMES, tracks=tracks)


def all_types():
    """Return cells of all types between random points."""
    points = np.random.default_rng(2).random((60, 3))
    return MeshSequence(waving(points, 2), cells=mixed_cells(80, 60), fps=10)


def save_and_load(sequence, folder, name):
    save(sequence, folder / name)
    return load(str(folder / name).replace("%d", "*"))


def assert_same_cells(loaded, expected):
    assert loaded.surface.cells.types.tolist() == expected.surface.cells.types.tolist()
    assert loaded.surface.cells.nodes.tolist() == expected.surface.cells.nodes.tolist()
    np.testing.assert_array_equal(loaded.faces, expected.faces)
    np.testing.assert_array_equal(loaded.vertices, expected.vertices)


@pytest.mark.parametrize("name", FILES)
def test_files_return_cells_values_and_times(tmp_path, name):
    sequence = block()
    loaded = save_and_load(sequence, tmp_path, name)
    assert_same_cells(loaded, sequence)
    for key, track in sequence.tracks.items():
        assert loaded.tracks[key].domain == track.domain
        np.testing.assert_array_equal(loaded.tracks[key].values, track.values)
    if name != "a_%d.vtu":
        assert loaded.times.tolist() == TIMES


@pytest.mark.parametrize("name", FILES)
def test_files_return_cells_of_all_types(tmp_path, name):
    sequence = all_types()
    assert_same_cells(save_and_load(sequence, tmp_path, name), sequence)


@pytest.mark.parametrize(
    ("name", "reader_class"),
    [("a_%d.vtu", vtkXMLUnstructuredGridReader), ("a.vtkhdf", vtkHDFReader)],
)
def test_vtk_reads_the_same_cells_and_values(tmp_path, name, reader_class):
    sequence, reader = block(), reader_class()
    path, *_ = save(sequence, tmp_path / name)
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for number, time in enumerate(TIMES if "%d" not in name else TIMES[:1]):
        reader.UpdateTimeStep(time)
        mesh = reader.GetOutputDataObject(0)
        assert mesh.GetClassName() == "vtkUnstructuredGrid"
        points = vtk_to_numpy(mesh.GetPoints().GetData())
        np.testing.assert_array_equal(points, sequence.vertices[number])
        nodes = vtk_to_numpy(mesh.GetCells().GetConnectivityArray())
        assert nodes.tolist() == sequence.surface.cells.nodes.tolist()
        assert {mesh.GetCellType(i) for i in range(mesh.GetNumberOfCells())} == {12}
        stress = vtk_to_numpy(mesh.GetCellData().GetArray("stress"))
        np.testing.assert_array_equal(stress, sequence.tracks["stress"][number])
        heat = vtk_to_numpy(mesh.GetPointData().GetArray("heat"))
        np.testing.assert_array_equal(heat, sequence.tracks["heat"][number][:, 0])


def test_voxels_and_pixels_become_hexahedra_and_quads(tmp_path, notes):
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    mesh = grid(cube, [(11, range(8)), (8, [0, 1, 2, 3])])
    loaded = load(write_mesh(vtkXMLUnstructuredGridWriter(), mesh, tmp_path / "a.vtu"), notes=notes)
    assert loaded.surface.cells.types.tolist() == [12, 9]
    assert loaded.surface.cells.nodes.tolist() == [0, 1, 3, 2, 4, 5, 7, 6, 0, 1, 3, 2]
    assert notes == [
        "1 cell of type 8 (pixel) became type 9 (quad)",
        "1 cell of type 11 (voxel) became type 12 (hexahedron)",
    ]


def with_values(points, cells):
    mesh = grid(points, cells)
    add_arrays(mesh.GetCellData(), number=np.arange(len(cells)) + 0.5)
    return mesh


TETRAHEDRON = (10, [0, 1, 2, 3])
NODES = np.random.default_rng(3).random((12, 3))


@pytest.mark.parametrize(
    ("cell", "types", "nodes", "note"),
    [
        ((2, [4, 5, 6]), [1, 1, 1], [4, 5, 6], "2 (poly-vertex) became 3 of type 1 (point)"),
        ((2, [4]), [1], [4], None),
        ((4, [4, 5, 6]), [3, 3], [4, 5, 5, 6], "4 (polyline) became 2 of type 3 (line)"),
        ((4, [4]), [], [], "4 (polyline) became 0 of type 3 (line)"),
        (
            (6, [4, 5, 6, 7]),
            [5, 5],
            [4, 5, 6, 5, 7, 6],
            "6 (triangle strip) became 2 of type 5 (triangle)",
        ),
        ((7, [4, 5, 6]), [5], [4, 5, 6], None),
        ((7, [4, 5, 6, 7]), [9], [4, 5, 6, 7], None),
        ((0, []), [], [], "0 (empty cell) became 0 of type 1 (point)"),
    ],
)
def test_cells_of_variable_size_are_split_next_to_solids(tmp_path, cell, types, nodes, note, notes):
    mesh = with_values(NODES, [TETRAHEDRON, cell, (10, [8, 9, 10, 11])])
    path = write_mesh(vtkXMLUnstructuredGridWriter(), mesh, tmp_path / "a.vtu")
    loaded = load(path, notes=notes)
    assert loaded.surface.cells.types.tolist() == [10, *types, 10]
    assert loaded.surface.cells.nodes.tolist() == [*range(4), *nodes, *range(8, 12)]
    values = loaded.tracks["number"]
    assert values.domain == "cell"
    assert values.values.ravel().tolist() == [0.5, *[1.5] * len(types), 2.5]
    np.testing.assert_array_equal(loaded.vertices[0], NODES)
    assert notes == ([f"1 cell of type {note}"] if note else [])


@pytest.mark.parametrize(
    ("cell", "name"),
    [
        ((7, [0, 1, 2, 4, 5]), "7 (polygon of more than 4 corners)"),
        ((30, [0, 1, 2, 3, 4, 5]), "30 (quadratic linear quad)"),
        ((35, [0, 1, 4, 5]), "35 (cubic line)"),
        ((71, [4, 5, 6, 7]), "71 (Lagrange cell)"),
    ],
)
def test_cells_that_cannot_be_stored_reduce_solids_to_their_surface(tmp_path, cell, name, notes):
    mesh = grid(NODES, [TETRAHEDRON, cell])
    loaded = load(write_mesh(vtkXMLUnstructuredGridWriter(), mesh, tmp_path / "a.vtu"), notes=notes)
    assert loaded.surface.cells is None
    solids = "2 solid cells" if cell[0] == 71 else "1 solid cell"
    n_interior = len(NODES) - loaded.n_verts
    assert (
        f"left out: the inside of {solids}, with {n_interior} nodes that no face has; cells of "
        f"type {name} cannot be stored"
    ) in notes


def test_values_of_faces_are_left_out_with_cells(tmp_path, notes):
    sequence = block()
    load_of_faces = Track(np.zeros((4, 32)), "face")
    sequence = sequence.replace(tracks={**sequence.tracks, "load": load_of_faces})
    save(sequence, tmp_path / "a.vtkhdf", notes=notes)
    assert any("load" in note and "tracks of faces" in note for note in notes)


@pytest.mark.parametrize("extension", [".ply", ".glb", ".vtp"])
def test_surface_formats_note_that_cells_are_left_out(tmp_path, extension, notes):
    if extension == ".ply":
        extension = "_%d.ply"
    save(block(), tmp_path / f"a{extension}".replace(".vtp", "_%d.vtp"), notes=notes)
    [note] = [note for note in notes if "cells left out" in note]
    assert note.startswith("12 cells left out, and stress of them: ")
