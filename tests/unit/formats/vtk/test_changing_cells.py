"""Files of VTK and XDMF whose cells change over time, written by VTK or by hand."""

from typing import Any

import numpy as np
import pytest

from meshreel.formats.load import load
from samples.meshes import grid_faces, waving_grid

pytest.importorskip("vtkmodules")
from vtkmodules.vtkCommonDataModel import VTK_HEXAHEDRON
from vtkmodules.vtkIOHDF import vtkHDFWriter
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter, vtkUnstructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

from samples.vtk import STEP_S, TimeSeries, add_arrays, grid, poly_data
from samples.vtk_text import inline_item, write_pvd

ROWS = (4, 4, 5, 5, 4, 6)
"""Rows of the grid in each frame, which has six columns."""

STARTS = (0, 2, 4, 5, 6)
"""First frames of the segments, and the number of all frames."""

N_LAYERS = (2, 2, 3, 3, 2, 4)
"""Cubes in each frame of a stack."""

WRITERS: dict[tuple[bool, bool], Any] = {
    (False, False): vtkXMLUnstructuredGridWriter,
    (False, True): vtkXMLPolyDataWriter,
    (True, False): vtkUnstructuredGridWriter,
    (True, True): vtkPolyDataWriter,
}
"""VTK's writer of frames: whether the format is the legacy one, and whether the mesh is a sheet."""


def points_of(frame):
    return waving_grid(len(ROWS), ROWS[frame], 6).vertices[frame]


def faces_of(frame):
    return grid_faces(ROWS[frame], 6)


def heat_of(frame):
    return np.float32(frame + 1) * points_of(frame)[:, 0]


def load_of(frame):
    return np.arange(len(faces_of(frame)), dtype=np.float64) + frame


def sheet(frame):
    """A vtkPolyData of triangles with an array at points and one at cells."""
    mesh = poly_data(points_of(frame), faces_of(frame).tolist())
    mesh.GetPointData().Initialize()
    mesh.GetCellData().Initialize()
    add_arrays(mesh.GetPointData(), heat=heat_of(frame))
    add_arrays(mesh.GetCellData(), load=load_of(frame))
    return mesh


def stack(frame):
    """A vtkUnstructuredGrid of cubes with an array at cells."""
    n_layers = N_LAYERS[frame]
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    points = [[*corner, layer + 0.1 * frame] for layer in range(n_layers + 1) for corner in square]
    cells = [(VTK_HEXAHEDRON, range(4 * layer, 4 * layer + 8)) for layer in range(n_layers)]
    mesh = grid(np.array(points, np.float32), cells)
    add_arrays(mesh.GetCellData(), load=np.arange(n_layers) + 10.0 * frame)
    return mesh


def write_frames(folder, meshes, *, legacy=False):
    """Write one file per frame, and return the pattern of their names."""
    is_sheet = meshes[0].IsA("vtkPolyData")
    extension = ".vtk" if legacy else ".vtp" if is_sheet else ".vtu"
    for number, mesh in enumerate(meshes):
        writer = WRITERS[legacy, bool(is_sheet)]()
        if legacy:
            writer.SetFileTypeToBinary()
        writer.SetFileName(str(folder / f"f_{number}{extension}"))
        writer.SetInputData(mesh)
        assert writer.Write()
    return str(folder / f"*{extension}")


def write_legacy_frames(folder, meshes):
    return write_frames(folder, meshes, legacy=True)


def write_collection(folder, meshes):
    write_frames(folder, meshes)
    files = sorted(path.name for path in folder.iterdir() if path.suffix in (".vtp", ".vtu"))
    rows = [f'timestep="{STEP_S * number}" file="{name}"' for number, name in enumerate(files)]
    return write_pvd(folder, rows)


def write_vtkhdf(folder, meshes):
    source, writer = TimeSeries(meshes), vtkHDFWriter()
    writer.SetInputConnection(source.GetOutputPort())
    writer.SetWriteAllTimeSteps(True)
    writer.SetFileName(str(folder / "a.vtkhdf"))
    assert writer.Write()
    return folder / "a.vtkhdf"


WRITE = [write_frames, write_legacy_frames, write_collection, write_vtkhdf]


@pytest.mark.slow
@pytest.mark.parametrize("write", WRITE)
def test_polygons_that_change_become_segments_with_their_arrays(tmp_path, write):
    source = write(tmp_path, [sheet(frame) for frame in range(len(ROWS))])
    assert_sheets(load(source, fps=1 / STEP_S))


@pytest.mark.parametrize("write", WRITE)
def test_solid_cells_that_change_become_segments(tmp_path, write, notes):
    source = write(tmp_path, [stack(frame) for frame in range(len(N_LAYERS))])
    loaded = load(source, fps=1 / STEP_S, notes=notes)
    assert not any("inside" in note for note in notes)
    assert loaded.starts == STARTS
    for segment, start in zip(loaded.segments, STARTS, strict=False):
        n_layers = N_LAYERS[start]
        assert (segment.n_verts, len(segment.faces)) == (4 * (n_layers + 1), 2 * (4 * n_layers + 2))
        assert segment.surface.cells.types.tolist() == [12] * n_layers
        assert segment.surface.cells.nodes[-8:].tolist() == [*range(segment.n_verts)[-8:]]
        for index, vertices in enumerate(segment.read(0, segment.n_frames)):
            assert vertices[:, 2].min() == pytest.approx(0.1 * (start + index))
            values = segment.tracks["load"].read(index, index + 1)[0, :, 0]
            assert values.tolist() == (np.arange(n_layers) + 10.0 * (start + index)).tolist()


def test_xdmf_grids_that_change_become_segments(tmp_path):
    """Topologies are inline, or refer to that of an earlier time."""
    grids = []
    for frame in range(len(ROWS)):
        faces, points = faces_of(frame), points_of(frame)
        facts = f'TopologyType="Triangle" NumberOfElements="{len(faces)}"'
        topology = f"<Topology {facts}>{inline_item(faces)}</Topology>"
        if frame == 1:
            place = "/Xdmf/Domain/Grid/Grid[1]/Topology"
            topology = f'<Topology Reference="XML">{place}</Topology>'
        arrays = "".join(
            f'<Attribute Name="{name}" Center="{center}">{inline_item(values)}</Attribute>'
            for name, center, values in (
                ("heat", "Node", heat_of(frame)), ("load", "Cell", load_of(frame))
            )
        )  # fmt: skip
        grids.append(
            f'<Grid Name="body"><Time Value="{STEP_S * frame}"/>{topology}'
            f'<Geometry GeometryType="XYZ">{inline_item(points)}</Geometry>{arrays}</Grid>'
        )
    text = '<Grid Name="walk" GridType="Collection" CollectionType="Temporal">'
    (tmp_path / "a.xdmf").write_text(
        f'<Xdmf Version="3.0"><Domain>{text}{"".join(grids)}</Grid></Domain></Xdmf>'
    )
    assert_sheets(load(tmp_path / "a.xdmf"))


@pytest.mark.slow
def test_array_that_only_later_steps_of_vtkhdf_have_is_left_out_with_a_note(tmp_path, notes):
    """VTK stores fewer offsets then, and not for which steps they are."""
    meshes = [sheet(frame) for frame in range(len(ROWS))]
    add_arrays(meshes[3].GetPointData(), late=heat_of(3))
    loaded = load(write_vtkhdf(tmp_path, meshes), notes=notes)
    assert_sheets(loaded)
    [note] = [note for note in notes if "late" in note]
    assert note.startswith("left out: arrays: late, with offsets for ")


def assert_sheets(found):
    assert (found.starts, found.fps, found.n_meshes) == (STARTS, 1 / STEP_S, 3)
    for number, (segment, start) in enumerate(zip(found.segments, STARTS, strict=False)):
        assert segment.start_s == pytest.approx(STEP_S * start)
        np.testing.assert_array_equal(segment.faces, faces_of(start))
        for index, frame in enumerate(range(start, STARTS[number + 1])):
            np.testing.assert_array_equal(segment.read(index, index + 1)[0], points_of(frame))
            for name, values in (("heat", heat_of(frame)), ("load", load_of(frame))):
                found_values = segment.tracks[name].read(index, index + 1)[0, :, 0]
                np.testing.assert_array_equal(found_values, values)
