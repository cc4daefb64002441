"""Interchange with independent readers and writers: trimesh and VTK."""

import io

import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.model.surface import Kind
from meshreel.operations.save import save
from samples.surfaces import CUBE_SIZES, attribute, rich_cube

trimesh = pytest.importorskip("trimesh")


def exported(sequence, **options):
    mesh = trimesh.Trimesh(sequence.vertices[0], sequence.faces, process=False)
    data = mesh.export(**options)
    return data if isinstance(data, bytes) else data.encode()


@pytest.mark.parametrize(
    ("extension", "options", "tolerance"),
    [
        ("obj", {"digits": 9}, 1e-8),
        ("off", {"digits": 9}, 1e-8),
        ("ply", {"encoding": "ascii"}, 1e-6),
        ("ply", {"encoding": "binary"}, 0),
    ],
)
def test_load_reads_meshes_of_trimesh(tmp_path, make_sequence, extension, options, tolerance):
    sequence = make_sequence(1)
    path = tmp_path / f"a.{extension}"
    path.write_bytes(exported(sequence, file_type=extension, **options))
    loaded = load(path)
    np.testing.assert_allclose(loaded.vertices, sequence.vertices, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(loaded.faces, sequence.faces)


@pytest.mark.parametrize(("kind", "tolerance"), [("stl", 0), ("stl_ascii", 1e-6)])
def test_load_reads_stl_of_trimesh(tmp_path, make_sequence, kind, tolerance):
    sequence = make_sequence(1)
    (tmp_path / "a.stl").write_bytes(exported(sequence, file_type=kind))
    loaded = load(tmp_path / "a.stl")
    triangles, expected = loaded.vertices[0][loaded.faces], sequence.vertices[0][sequence.faces]
    np.testing.assert_allclose(triangles, expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("extension", ["obj", "off", "ply", "stl"])
def test_trimesh_reads_saved_meshes(tmp_path, make_sequence, extension):
    sequence = make_sequence(1)
    [path] = save(sequence, tmp_path / f"a.{extension}")
    mesh = trimesh.load(io.BytesIO(path.read_bytes()), file_type=extension, process=False)
    expected = sequence.vertices[0][sequence.faces]
    np.testing.assert_array_equal(np.asarray(mesh.triangles, np.float32), expected)


def vtk_mesh(module, reader, path):
    """Read a file with a VTK reader."""
    vtk_reader = getattr(pytest.importorskip(f"vtkmodules.{module}"), reader)()
    vtk_reader.SetFileName(str(path))
    vtk_reader.Update()
    return vtk_reader.GetOutput()


def test_vtk_reads_colors_and_uv_of_saved_ply(tmp_path):
    color, uv = attribute(Kind.COLOR, "vertex", 4, np.uint8), attribute(Kind.UV, "vertex", 2)
    (path,) = save(rich_cube(1, attributes=[color, uv]), tmp_path / "a.ply")
    result = vtk_mesh("vtkIOPLY", "vtkPLYReader", path).GetPointData()
    np.testing.assert_array_equal(result.GetScalars(), color.values)
    np.testing.assert_array_equal(result.GetTCoords(), uv.values)


def test_vtk_reads_polygons_and_uv_of_saved_obj(tmp_path):
    uv = attribute(Kind.UV, "corner", 2, rows=9)
    (path,) = save(rich_cube(1, attributes=[uv]), tmp_path / "a.obj")
    result = vtk_mesh("vtkIOGeometry", "vtkOBJReader", path)
    polys = result.GetPolys()
    assert np.diff(polys.GetOffsetsArray()).tolist() == list(CUBE_SIZES)
    rows = np.array(result.GetPointData().GetTCoords())[np.array(polys.GetConnectivityArray())]
    np.testing.assert_allclose(rows, uv.per_item(), rtol=1e-6)  # VTK rounds values on reading
