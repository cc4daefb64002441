"""Merging of tracks of meshes with different frame times."""

from dataclasses import replace

import numpy as np

from meshreel.formats.options import Reading
from meshreel.formats.scenes.merging import merge_meshes
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.scene_source import open_mesh
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.notes import Notes
from meshreel.model.tracks import Track, TrackPart

POINTS = np.eye(3)


def mesh(name, times, **tracks):
    """A triangle mesh with vertex tracks."""
    counts, corners = np.array([3]), np.arange(3, dtype=np.int32)
    tracks = {
        name: values if isinstance(values, Track) else Track(values)
        for name, values in tracks.items()
    }
    return SceneMesh(
        name,
        np.array(times, np.float64),
        lambda index: PolygonMesh(POINTS + index, counts, corners),
        tracks=lambda frames: {key: TrackPart(track, frames) for key, track in tracks.items()},
    )


def of_three(values, dtype=np.float64):
    """Track values for three vertices that are equal within each frame."""
    return np.repeat(np.array(values, dtype)[:, None], 3, axis=1)


def merged(tmp_path, *meshes):
    notes = Notes()
    whole = merge_meshes(meshes, "whole", notes)
    return next(open_mesh(whole, tmp_path, Reading(notes=notes))).tracks, notes


def test_track_values_are_interpolated_between_frames(tmp_path):
    fine = mesh("/fine", [0, 1, 2], heat=of_three([0, 5, 6]), step=of_three([1, 2, 3], np.int32))
    coarse = mesh("/coarse", [0, 2], heat=of_three([10, 20]), step=of_three([7, 8], np.int32))
    tracks, notes = merged(tmp_path, fine, coarse)
    assert tracks["heat"].values[:, ::3, 0].tolist() == [[0, 10], [5, 15], [6, 20]]
    assert tracks["step"].values[:, ::3, 0].tolist() == [[1, 7], [2, 7], [3, 8]]
    assert tracks["step"].dtype == np.int32
    assert notes == []


def test_track_is_nan_in_meshes_without_it(tmp_path):
    first = mesh("/a", [0, 1], step=of_three([1, 2], np.int32))
    tracks, notes = merged(tmp_path, first, mesh("/b", [0, 1]))
    assert tracks["step"].dtype == np.float64
    assert tracks["step"].values[:, 0, 0].tolist() == [1, 2]
    assert np.isnan(tracks["step"].values[:, 3:]).all()
    assert notes == ["track 'step' is in 1 of 2 meshes, and NaN in the others"]


def test_bytes_of_a_color_become_fractions_where_a_mesh_has_none(tmp_path):
    colors = Track(np.full((2, 3, 3), 51, np.uint8), "vertex", "color")
    tracks, _ = merged(tmp_path, mesh("/a", [0, 1], Cd=colors), mesh("/b", [0, 1]))
    assert tracks["Cd"].kind == "color"
    np.testing.assert_allclose(tracks["Cd"].values[:, :3], 0.2)
    assert np.isnan(tracks["Cd"].values[:, 3:]).all()


def test_merged_positions_equal_those_of_frames():
    points = np.random.default_rng(0).normal(size=(3, 3, 3)).astype(np.float32)
    meshes = [
        replace(
            mesh("/m", times),
            frame=lambda index: PolygonMesh(points[index], np.array([3]), np.arange(3)),
            positions=lambda start, stop: points[start:stop],
        )
        for times in ([0, 1, 2], [0.5, 1.25], [1])
    ]
    whole = merge_meshes(meshes, "whole", Notes())
    frames = np.stack([whole.frame(index).vertices for index in range(len(whole.times_s))])
    assert len(frames) == 5
    for start in range(5):
        np.testing.assert_allclose(whole.positions(start, 5), frames[start:], atol=1e-6)
    assert merge_meshes([*meshes, mesh("/changing", [0])], "", Notes()).positions is None


def test_tracks_that_differ_between_meshes_are_left_out(tmp_path):
    first = mesh("/a", [0, 1], flow=of_three([1, 2]))
    for flow in (np.zeros((2, 3, 3)), Track(of_three([1, 2]), unit="mm")):
        tracks, notes = merged(tmp_path, first, mesh("/b", [0, 1], flow=flow))
        assert not tracks
        assert notes == ["left out: tracks that differ between meshes: flow"]
