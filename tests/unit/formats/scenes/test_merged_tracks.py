"""Tracks of several meshes that are one, sampled at times of their own."""

import numpy as np

from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.merging import merged_mesh
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.scene_source import sequence_of
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.tracks import Track, TrackPart

POINTS = np.eye(3)


def mesh(name, times, **tracks):
    """A triangle with tracks at its vertices."""
    counts, corners = np.array([3]), np.arange(3, dtype=np.int32)
    tracks = {name: Track(values) for name, values in tracks.items()}
    return SceneMesh(
        name,
        np.array(times, np.float64),
        lambda index: PolygonMesh(POINTS + index, counts, corners),
        tracks=lambda frames: {key: TrackPart(one, frames) for key, one in tracks.items()},
    )


def of_three(values, dtype=np.float64):
    """Values of frames, the same at three vertices."""
    return np.repeat(np.array(values, dtype)[:, None], 3, axis=1)


def merged(tmp_path, *meshes):
    notes = []
    whole = merged_mesh(meshes, "whole", notes)
    return sequence_of(whole, tmp_path, ReadOptions(notes=notes)).tracks, notes


def test_values_are_between_those_of_two_frames_when_a_mesh_has_none_at_a_time(tmp_path):
    fine = mesh("/fine", [0, 1, 2], heat=of_three([0, 5, 6]), step=of_three([1, 2, 3], np.int32))
    coarse = mesh("/coarse", [0, 2], heat=of_three([10, 20]), step=of_three([7, 8], np.int32))
    tracks, notes = merged(tmp_path, fine, coarse)
    assert tracks["heat"].values[:, ::3, 0].tolist() == [[0, 10], [5, 15], [6, 20]]
    assert tracks["step"].values[:, ::3, 0].tolist() == [[1, 7], [2, 7], [3, 8]]
    assert tracks["step"].dtype == np.int32
    assert notes == []


def test_values_are_missing_where_a_mesh_does_not_have_the_track(tmp_path):
    first = mesh("/a", [0, 1], step=of_three([1, 2], np.int32))
    tracks, notes = merged(tmp_path, first, mesh("/b", [0, 1]))
    assert tracks["step"].dtype == np.float64
    assert tracks["step"].values[:, 0, 0].tolist() == [1, 2]
    assert np.isnan(tracks["step"].values[:, 3:]).all()
    assert notes == ["track 'step' is of 1 of 2 meshes, and NaN in the others"]


def test_track_is_left_out_when_meshes_do_not_have_it_alike(tmp_path):
    first = mesh("/a", [0, 1], flow=of_three([1, 2]))
    second = mesh("/b", [0, 1], flow=np.zeros((2, 3, 3)))
    tracks, notes = merged(tmp_path, first, second)
    assert not tracks
    assert notes == ["left out: tracks that not all meshes have alike: flow"]
