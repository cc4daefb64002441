"""Files that the library VTK reads in a separate process."""

import os
import sys
import tempfile
from collections import Counter

import numpy as np
import pytest
from scipy.io import netcdf_file

from meshreel.errors import FormatError
from meshreel.formats.frames.stored_frames import RawArray
from meshreel.formats.load import load, open_for_encoding
from meshreel.formats.options import Reading
from meshreel.formats.vtk import library_readers

pytest.importorskip("vtkmodules")
from vtkmodules.vtkIOExodus import vtkExodusIIWriter

from samples.programs import output_of
from samples.vtk import STEP_S, TimeSeries, add_arrays, grid

NODES = np.array(list(np.ndindex(2, 2, 3)), float)[:, ::-1] / 3
"""Of two hexahedra side by side, to more digits than float32 has."""

HEXAHEDRA = [[0, 1, 4, 3, 6, 7, 10, 9], [1, 2, 5, 4, 7, 8, 11, 10]]
FACES = [
    [1, 4, 10, 7], [0, 6, 9, 3], [2, 5, 11, 8], [0, 3, 4, 1], [1, 4, 5, 2], [6, 7, 10, 9],
    [7, 8, 11, 10], [0, 1, 7, 6], [1, 2, 8, 7], [3, 9, 10, 4], [4, 10, 11, 5],
]  # fmt: skip
"""Faces of the hexahedra, the first one between them."""

OWNERS = [0, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1]
HEXAHEDRAL = NODES, FACES, OWNERS, 4  # the number of Fluent for hexahedra

CUBE = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float)
SIDES = [
    [7, 5, 1, 3], [0, 3, 1], [4, 5, 7], [0, 1, 5, 4], [3, 0, 4, 7], [1, 3, 2], [5, 6, 7],
    [1, 2, 6, 5], [2, 3, 7, 6],
]  # fmt: skip
WEDGES = CUBE, SIDES, [0, 0, 0, 0, 0, 1, 1, 1, 1], 6  # two halves

SHIFT = np.outer(np.arange(12), [0.01, 0.02, 0])
TENSION = np.array([1 / 3, 2])
N_STEPS = 3


def exodus_of_vtk(path):
    """Write a block for each hexahedron, moved by a displacement; block 7 is called steel."""
    meshes = []
    for step in range(N_STEPS):
        mesh = grid(NODES, [(12, nodes) for nodes in HEXAHEDRA])
        add_arrays(mesh.GetPointData(), Displacement=step * SHIFT)
        add_arrays(mesh.GetCellData(), tension=step * TENSION, block=np.array([7, 5], np.int32))
        meshes.append(mesh)
    source, writer = TimeSeries(meshes), vtkExodusIIWriter()
    writer.SetInputConnection(source.GetOutputPort())
    writer.SetFileName(path)
    writer.SetBlockIdArrayName("block")
    writer.WriteAllTimeStepsOn()
    assert writer.Write()
    with netcdf_file(path, "a") as file:
        row = file.variables["eb_prop1"][:].tolist().index(7)
        file.createVariable("elem_num_map", "i4", ("num_elem",))[:] = [4, 9]
        file.variables["eb_names"][row, :5] = np.frombuffer(b"steel", "S1")


@pytest.fixture(scope="module")
def exodus(tmp_path_factory):
    """A file of VTK's writer, which may end its process after other writers of VTK."""
    path = tmp_path_factory.mktemp("exodus") / "a.e"
    environment = {"PYTHONPATH": os.pathsep.join(sys.path)}
    output_of(sys.executable, __file__, path, environment=environment)
    return path


def foam(folder, name, kind, text):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(f"FoamFile {{ format ascii; class {kind}; object {name}; }}\n{text}")


def listing(rows):
    """Text of a list of OpenFOAM, or of a list of lists."""
    texts = [str(row) if np.isscalar(row) else listing(row) for row in rows]
    return f"{len(texts)} ({' '.join(texts)})"


def write_open_foam(path, content=HEXAHEDRAL):
    nodes, faces, owners, _ = content
    mesh = path.parent / "constant" / "polyMesh"
    walls = f"type wall; nFaces {len(faces) - 1}; startFace 1;"
    points = " ".join(f"({x} {y} {z})" for x, y, z in nodes.tolist())
    foam(mesh, "points", "vectorField", f"{len(nodes)} ({points})")
    foam(mesh, "faces", "faceList", listing(faces))
    foam(mesh, "owner", "labelList", listing(owners))
    foam(mesh, "neighbour", "labelList", "1 (1)")
    foam(mesh, "boundary", "polyBoundaryMesh", f"1 (walls {{ {walls} }})")
    for step in range(N_STEPS):
        values = " ".join(map(str, (step * TENSION).tolist()))
        text = f"dimensions [0 0 0 0 0 0 0]; internalField nonuniform List<scalar> 2 ({values});"
        boundary = "boundaryField { walls { type zeroGradient; } }"
        folder = path.parent / f"{step * STEP_S:g}"
        foam(folder, "tension", "volScalarField", f"{text} {boundary}")
    foam(path.parent / "0", "phi", "surfaceScalarField", "internalField uniform 0;")
    foam(mesh, "cellZones", "regIOobject", "0()")
    path.touch()
    return path


def write_fluent(path, content=HEXAHEDRAL):
    """Write an ASCII case with one time."""
    nodes, faces, owners, kind = content

    def section(number, head, rows=()):
        body = f"(\n{chr(10).join(' '.join(map(str, row)) for row in rows)}\n)" if rows else ""
        return f"({number} ({head}){body})\n"

    numbers = [
        [f"{node + 1:x}" for node in [len(face) - 1, *face, owner, -1 if number else 1 - owner]]
        for number, (face, owner) in enumerate(zip(faces, owners, strict=True))
    ]
    path.write_text(
        "(2 3)\n"
        + section(10, f"0 1 {len(nodes):x} 0 3")
        + section(10, f"1 1 {len(nodes):x} 1 3", nodes.tolist())
        + section(12, "0 1 2 0 0")
        + section(12, f"2 1 2 1 {kind}")
        + section(13, f"0 1 {len(faces):x} 0 0")
        + section(13, "3 1 1 2 0", numbers[:1])
        + section(13, f"4 2 {len(faces):x} 3 0", numbers[1:])
        + "(45 (2 fluid fluid)())\n(45 (3 interior inside)())\n(45 (4 wall walls)())\n"
    )
    return path


CGNS = {
    "CGNSLibraryVersion": ("CGNSLibraryVersion_t", "R4", np.float32([3.4])),
    "Base": ("CGNSBase_t", "I4", np.int32([3, 3])),
    "Base/steel": ("Family_t", "MT", None),
    "Base/plate": ("Zone_t", "I4", np.int32([[12], [2], [0]])),
    "Base/plate/ZoneType": ("ZoneType_t", "C1", np.frombuffer(b"Unstructured", "i1")),
    "Base/plate/GridCoordinates": ("GridCoordinates_t", "MT", None),
    **{
        f"Base/plate/GridCoordinates/Coordinate{axis}": ("DataArray_t", "R8", column)
        for axis, column in zip("XYZ", NODES.T, strict=True)
    },
    "Base/plate/cells": ("Elements_t", "I4", np.int32([17, 0])),
    "Base/plate/cells/ElementRange": ("IndexRange_t", "I4", np.int32([1, 2])),
    "Base/plate/cells/ElementConnectivity": (
        "DataArray_t", "I4", np.int32(HEXAHEDRA).ravel() + 1,
    ),
    "Base/plate/ZoneBC": ("ZoneBC_t", "MT", None),
    "Base/plate/ZoneBC/inlet": ("BC_t", "C1", np.frombuffer(b"BCInflow", "i1")),
}  # fmt: skip
"""Label, type and data of each node of two hexahedra."""


def write_cgns(path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", track_order=True) as file:
        file[" format"] = np.frombuffer(b"IEEE_LITTLE_32\0", "i1")
        file[" hdf5version"] = np.frombuffer(b"HDF5 Version 1.8".ljust(33, b"\0"), "i1")
        for name, (label, kind, data) in {
            "": ("Root Node of HDF5 File", "MT", None),
            **CGNS,
        }.items():
            node = file.create_group(name, track_order=True) if name else file
            texts = {"name": (name.split("/")[-1] or "HDF5 MotherNode", 33), "label": (label, 33)}
            for key, (text, size) in {**texts, "type": (kind, 3)}.items():
                node.attrs.create(key, text.encode(), dtype=h5py.string_dtype("ascii", size))
            node.attrs["flags"] = np.int32([1])
            if data is not None:
                node[" data"] = data
    return path


def corners(sequence):
    """Nodes of each cell in ascending order."""
    return np.sort(sequence.surface.cells.nodes.reshape(-1, 8)).tolist()


def test_exodus_is_read_exactly_and_its_blocks_are_joined(exodus, notes):
    result = load(exodus, notes=notes)
    assert result.fps == 1 / STEP_S
    steps = np.arange(N_STEPS)[:, None, None]
    np.testing.assert_array_equal(result.tracks["Displacement"].values, steps * SHIFT)
    np.testing.assert_array_equal(result.vertices, [NODES] * N_STEPS)
    rows = [HEXAHEDRA.index(nodes) for nodes in result.surface.cells.nodes.reshape(-1, 8).tolist()]
    assert sorted(rows) == [0, 1]
    tension = result.tracks["tension"].values[..., 0]
    np.testing.assert_array_equal(tension, steps[..., 0] * TENSION[rows])
    numbers, ids = (attribute.values.ravel() for attribute in result.surface.attributes)
    assert ids.tolist() == [[7, 5][row] for row in rows]
    [names] = result.surface.groups
    assert names.labels == ("steel",)
    assert numbers.tolist() == [[0, -1][row] for row in rows]
    assert set(names.numbers.tolist()) == {0, -1}
    assert notes[:2] == ["left out: user numbers: elem_num_map", "left out: field data: Title"]
    assert notes[2].startswith("the mesh does not move, and its track Displacement may be its disp")


def test_frames_of_exodus_are_read_on_demand(exodus, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    expected, result = load(exodus), open_for_encoding(exodus, 1.0, Reading())
    np.testing.assert_array_equal(result.read(1, 3), expected.vertices[1:])
    tension = expected.tracks["tension"].values
    np.testing.assert_array_equal(result.tracks["tension"].read(1, 3), tension[1:])
    assert len([*tmp_path.iterdir()]) == 1  # the steps
    del result
    assert not [*tmp_path.iterdir()]  # without a collection of cycles


def test_values_of_tracks_are_read_once(exodus, monkeypatch):
    reads, read = Counter(), RawArray.read
    monkeypatch.setattr(
        RawArray, "read", lambda self, *rows: reads.update([self]) or read(self, *rows)
    )
    load(exodus)
    counts = sorted(count for array, count in reads.items() if array.dtype.kind == "f")
    assert counts == [1] * 2 * N_STEPS + [N_STEPS]  # all steps have the same points


def test_open_foam_is_read(tmp_path, notes):
    result = load(write_open_foam(tmp_path / "case.foam"), notes=notes)
    assert (result.n_frames, result.fps) == (N_STEPS, 1 / STEP_S)
    np.testing.assert_array_equal(result.vertices[0], NODES.astype(np.float32))
    assert corners(result) == np.sort(HEXAHEDRA).tolist()
    assert result.tracks.keys() == {"tension"}
    expected = np.outer(np.arange(N_STEPS), TENSION).astype(np.float32)
    np.testing.assert_array_equal(result.tracks["tension"].values[..., 0], expected)
    assert notes == [
        "left out: patches: patch/walls",
        "left out: files: 0/phi, constant/polyMesh/cellZones",
        "left out: units: dimensions of fields",
    ]


def test_cells_of_fluent_are_read(tmp_path, notes):
    result = load(write_fluent(tmp_path / "a.cas"), notes=notes)
    np.testing.assert_array_equal(result.vertices, [NODES.astype(np.float32)])
    assert corners(result) == np.sort(HEXAHEDRA).tolist()
    assert notes == ["left out: zones of faces: inside:interior, walls:wall"]


def test_other_nodes_of_cgns_are_noted(tmp_path, notes):
    result = load(write_cgns(tmp_path / "a.cgns"), notes=notes)
    np.testing.assert_array_equal(result.vertices, [NODES])
    assert result.surface.groups[0].labels == ("plate",)
    assert notes == ["left out: nodes BC_t: inlet", "left out: nodes Family_t: steel"]


@pytest.mark.parametrize("write", [write_open_foam, write_fluent])
def test_wedges_of_faces_have_positive_volumes(tmp_path, write):
    result = load(write(tmp_path / {write_fluent: "a.cas"}.get(write, "a.foam"), WEDGES))
    nodes = result.vertices[0].astype(float)[result.surface.cells.nodes.reshape(2, 6)]
    assert np.linalg.det(nodes[:, 1:4] - nodes[:, :1]) == pytest.approx(1)


@pytest.mark.parametrize("extension", [".e", ".foam", ".cgns"])
def test_damaged_files_are_errors_that_name_the_reader(tmp_path, exodus, extension):
    path = write_open_foam(tmp_path / "a.foam").with_suffix(extension)
    (tmp_path / "constant" / "polyMesh" / "faces").write_bytes(b"FoamFile {")
    if extension != ".foam":
        path.write_bytes(exodus.read_bytes()[:500])
    with pytest.raises(
        FormatError, match=rf"^{path}: is not .*, or is damaged: vtk\w+Reader of VTK"
    ):
        load(path)


def test_the_end_of_the_process_is_an_error(exodus, monkeypatch):
    monkeypatch.setattr(library_readers, "STORE", "import os; os.abort()")
    with pytest.raises(FormatError, match=r"VTK failed \(its process ended with (SIGABRT|\d+)\)"):
        load(exodus)


def test_declared_sizes_do_not_fill_the_memory(tmp_path, exodus):
    data, path = exodus.read_bytes(), tmp_path / "a.e"
    n_nodes, many = b"num_nodes\0\0\0\0\0\0\x0c", b"num_nodes\0\0\0\x7f\xff\xff\xff"
    assert data.count(n_nodes) == 1
    path.write_bytes(data.replace(n_nodes, many))
    with pytest.raises(FormatError, match="VTK failed"):
        load(path)


if __name__ == "__main__":
    exodus_of_vtk(sys.argv[1])
