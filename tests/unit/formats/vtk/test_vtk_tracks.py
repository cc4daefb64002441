"""Tracks in VTKHDF files, written by meshreel or by other programs."""

import numpy as np
import pytest

from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.model.tracks import TrackKind
from meshreel.operations.save import save
from samples.datasets import surface_of_arrays
from samples.meshes import assert_same_surface
from samples.opening import open_source
from samples.tracks import assert_same_tracks, tracked_sheet

h5py = pytest.importorskip("h5py")

DOMAINS = ("vertex", "face")
RNG = np.random.default_rng(2)


def change(path, place, values, starts=None, **properties):
    """Store the concatenated values of all steps in a VTKHDF file."""
    with h5py.File(path, "a") as file:
        file[f"VTKHDF/{place}"] = values
        file[f"VTKHDF/{place}"].attrs.update(properties)
        if starts is not None:
            side, name = place.split("/")
            file[f"VTKHDF/Steps/{side}Offsets/{name}"] = starts


@pytest.mark.slow
@pytest.mark.parametrize("n_frames", [1, 6])
def test_vtkhdf_tracks_round_trip_exactly(tmp_path, n_frames, read, notes):
    sheet = tracked_sheet(n_frames, DOMAINS)
    [path] = save(sheet, tmp_path / "a.vtkhdf")
    result = read(path, notes=notes)
    assert isinstance(result, StoredFrames) == (read is open_source)
    assert_same_tracks(result.tracks, sheet.tracks)
    assert_same_surface(result.surface, surface_of_arrays(sheet.surface))
    assert notes == []


@pytest.mark.slow
def test_corner_tracks_are_left_out_with_a_note(tmp_path, notes):
    [path] = save(tracked_sheet(), tmp_path / "a.vtkhdf", notes=notes)
    names = "heat of corner/s, flow_corner, shade_corner, step_corner, tensor_corner"
    said = f"tracks left out: {names}: .vtkhdf cannot store tracks of corners"
    assert [note for note in notes if note.startswith("tracks")] == [said]
    assert_same_tracks(load(path).tracks, tracked_sheet(6, DOMAINS).tracks)


def test_vtk_reads_the_tracks_of_every_step(tmp_path):
    pytest.importorskip("vtkmodules")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    sheet = tracked_sheet(4, DOMAINS)
    save(sheet, tmp_path / "a.vtkhdf")
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    reader.UpdateInformation()
    for step in range(4):
        reader.SetStep(step)
        reader.Update()
        output = reader.GetOutputDataObject(0)
        for name, track in sheet.tracks.items():
            data = output.GetPointData() if track.domain == "vertex" else output.GetCellData()
            result = vtk_to_numpy(data.GetArray(name.replace("/", "_")))
            assert result.dtype == track.dtype
            assert result.tobytes() == track[step].tobytes()


def test_arrays_added_by_another_program_are_tracks(tmp_path):
    sheet = tracked_sheet(3, ())
    [path] = save(sheet, tmp_path / "a.vtkhdf")
    n_faces = sheet.surface.n_faces(sheet.n_faces)
    flow = RNG.normal(size=(3 * 30, 3)).astype(np.float32)
    change(path, "PointData/flow", flow)  # without offsets, rows follow those of Points
    area = RNG.integers(0, 9, 3 * n_faces)
    change(path, "CellData/area", area, np.arange(3) * n_faces)
    change(path, "PointData/map", RNG.random((90, 2)), Attribute=np.bytes_("TCoords"))
    tracks = load(path).tracks
    assert tracks["map"].kind is TrackKind.UV
    assert np.array_equal(tracks["flow"].values, flow.reshape(3, 30, 3))
    assert (tracks["flow"].kind, tracks["flow"].domain) == (TrackKind.VECTOR, "vertex")
    assert np.array_equal(tracks["area"].values[..., 0], area.reshape(3, n_faces))
    assert tracks["area"].domain == "face"


@pytest.mark.parametrize(("length", "kind"), [(1.0, "normal"), (2.0, "vector")])
def test_only_unit_vectors_called_normals_are_normals(tmp_path, length, kind):
    [path] = save(tracked_sheet(3, ()), tmp_path / "a.vtkhdf")
    vectors = RNG.normal(size=(90, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    vectors[80] *= length
    change(path, "PointData/Normals", vectors)
    assert load(path).tracks["Normals"].kind == kind


def test_face_track_is_renamed_if_a_vertex_track_has_its_name(tmp_path, notes):
    sheet = tracked_sheet(3, ())
    [path] = save(sheet, tmp_path / "a.vtkhdf")
    n_faces = sheet.surface.n_faces(sheet.n_faces)
    change(path, "PointData/heat", np.arange(90.0), np.arange(3) * 30)
    change(path, "CellData/heat", np.arange(3.0 * n_faces), np.arange(3) * n_faces)
    tracks = load(path, notes=notes).tracks
    assert {name: str(track.domain) for name, track in tracks.items()} == {
        "heat": "vertex",
        "heat (faces)": "face",
    }
    assert notes == ["'heat' is at points and at cells; the one of faces is called 'heat (faces)'"]


def test_steps_that_an_array_is_too_short_for_are_nan_with_a_note(tmp_path, notes):
    [path] = save(tracked_sheet(3, ()), tmp_path / "a.vtkhdf")
    change(path, "PointData/heat", np.zeros(89), np.arange(3) * 30)
    values = load(path, notes=notes).tracks["heat"].values
    assert np.isnan(values[2]).all()
    assert (values[:2] == 0).all()
    assert notes == [
        "left out: array 'heat', which has 89 rows; step 2 needs 30 from row 60 on",
        "'heat' is in 2 of 3 frames, and NaN in the others",
    ]


def test_array_with_offsets_for_too_few_steps_is_left_out_with_a_note(tmp_path, notes):
    [path] = save(tracked_sheet(3, ()), tmp_path / "a.vtkhdf")
    change(path, "PointData/heat", np.zeros(90), np.arange(2) * 30)
    assert not load(path, notes=notes).tracks
    assert notes == ["left out: arrays: heat, with offsets for 2 of 3 steps"]


def test_array_with_too_many_components_is_left_out_with_a_note(tmp_path, notes):
    [path] = save(tracked_sheet(2, ()), tmp_path / "a.vtkhdf")
    change(path, "PointData/spectrum", np.zeros((60, 257), np.uint8))
    assert not load(path, notes=notes).tracks
    assert notes == ["left out: fields of text, or with more than 256 components: spectrum"]
