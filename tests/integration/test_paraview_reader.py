"""The reader of ParaView, run by VTK."""

import runpy
from pathlib import Path

import numpy as np
import pytest

import meshreel
from samples.meshes import waving_grid

pytest.importorskip("vtkmodules")
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

PLUG_IN = Path(__file__).parents[2] / "integrations" / "paraview" / "meshreel_reader.py"
BLOCK = np.array(list(np.ndindex(3, 2, 2)), np.float64)
HEXAHEDRA = np.array([[0, 4, 6, 2, 1, 5, 7, 3], [4, 8, 10, 6, 5, 9, 11, 7]])
MATERIAL = meshreel.Attribute("material", "other", "cell", np.array([[3], [4]], np.int32))


@pytest.fixture
def opened(tmp_path):
    reader = runpy.run_path(str(PLUG_IN))["MeshreelReader"]()

    def open_sequence(sequence):
        path = tmp_path / "a.reel"
        path.write_bytes(meshreel.encode(sequence, lossless=True))
        reader.SetFileName(str(path))
        reader.UpdateInformation()
        return reader

    yield open_sequence
    reader.SetFileName("")


def frame_at(reader, time_s):
    """Points, cells and arrays at a time."""
    reader.UpdateTimeStep(time_s)
    mesh = reader.GetOutputDataObject(0)
    arrays = [
        {
            data.GetArrayName(row): vtk_to_numpy(data.GetArray(row))
            for row in range(data.GetNumberOfArrays())
        }
        for data in (mesh.GetPointData(), mesh.GetCellData())
    ]
    points = vtk_to_numpy(mesh.GetPoints().GetData())
    return points, vtk_to_numpy(mesh.GetCells().GetConnectivityArray()), *arrays


def test_cells_and_tracks_are_those_of_the_requested_frame(opened):
    times = np.array([0.0, 0.5, 2.0])
    speed, stress = times[:, None, None] * BLOCK, np.outer(times, [1.0, 2.0])
    sequence = meshreel.MeshSequence(
        BLOCK + times[:, None, None],
        cells=meshreel.Cells(np.full(2, 12), HEXAHEDRA.ravel()),
        times=times,
        tracks={"speed": speed, "stress": meshreel.Track(stress, domain="cell")},
        surface=meshreel.Surface(attributes=(MATERIAL,)),
    )
    reader = opened(sequence)
    assert reader.GetTimestepValues() == times.tolist()
    for frame, time in [(2, 2.0), (0, 0.0), (1, 0.5), (1, 1.9), (2, 5.0)]:
        points, nodes, of_points, of_cells = frame_at(reader, time)
        np.testing.assert_array_equal(points, BLOCK + times[frame])
        np.testing.assert_array_equal(nodes, HEXAHEDRA.ravel())
        assert (of_points.keys(), of_cells.keys()) == ({"speed"}, {"material", "stress"})
        np.testing.assert_array_equal(of_points["speed"], speed[frame])
        np.testing.assert_array_equal(of_cells["stress"], stress[frame])
        np.testing.assert_array_equal(of_cells["material"], [3, 4])


def test_changing_faces_without_a_rate_are_read(opened):
    parts = [waving_grid(2, 4, 5).replace(fps=0), waving_grid(1, 3, 6).replace(fps=0)]
    reader = opened(meshreel.MeshSequence.of_segments(parts))
    assert reader.GetTimestepValues() == [0, 1, 2]
    for time, part, frame in [(1, 0, 1), (2, 1, 0), (0, 0, 0)]:
        points, corners, *_ = frame_at(reader, time)
        np.testing.assert_array_equal(points, parts[part].vertices[frame])
        np.testing.assert_array_equal(corners, parts[part].faces.ravel())


def test_values_of_corners_are_named(opened):
    faces = waving_grid(1).faces
    values = np.zeros((1, faces.size))
    before, window = vtkOutputWindow.GetInstance(), vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    try:
        frame_at(opened(waving_grid(1).replace(tracks={"shade": values})), 0)
    finally:
        vtkOutputWindow.SetInstance(before)
    assert "left out, as it fits neither points nor cells: shade" in window.GetOutput()
