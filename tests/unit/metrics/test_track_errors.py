"""Errors of tracks, in their units."""

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.metrics.track_errors import errors_of_tracks, track_errors
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track
from samples.meshes import waving_grid


def zeros(*shape, **given):
    return Track(np.zeros(shape), **given)


def changed(track, place, value):
    values = track.values.copy()
    values[place] = value
    return Track(values, track.domain, track.kind, track.unit)


def test_error_is_the_length_of_the_difference():
    track = zeros(4, 6, 3, unit="m/s")
    result = track_errors(track, changed(track, (2, 5), [3, 4, 0]))
    assert (result.largest, result.unit) == (5, "m/s")
    assert result.largest_of_frames.tolist() == [0, 0, 5, 0]
    assert result.rms == pytest.approx(5 / np.sqrt(24))
    assert result.rms_of_frames[2] == pytest.approx(5 / np.sqrt(6))


def test_error_of_a_color_is_that_of_its_worst_component():
    track = zeros(2, 3, 4, kind="color")
    assert track_errors(track, changed(track, (0, 1), [0.1, -0.3, 0.2, 0])).largest == 0.3


def test_error_of_a_normal_is_an_angle():
    up = Track(np.tile([0.0, 0.0, 2.0], (1, 3, 1)), kind="normal")
    result = track_errors(up, changed(up, (0, 1), [0, np.sin(0.2), np.cos(0.2)]))
    assert (result.largest, result.unit) == (pytest.approx(np.degrees(0.2)), "deg")
    missing = changed(up, (0, 0), 0)
    assert track_errors(up, changed(up, (0, 0), [0, 0, 3])).largest == pytest.approx(0)
    assert track_errors(up, changed(up, (0, 2), [0, 0, -0.5])).largest == 180
    assert track_errors(up, missing).largest == track_errors(missing, up).largest == 180
    assert track_errors(missing, missing).largest == 0


def test_errors_include_frames_compared_in_pieces(monkeypatch):
    monkeypatch.setattr("meshreel.metrics.track_errors.NUMBERS_PER_CHUNK", 2 * 6)
    track = zeros(5, 6)
    result = track_errors(track, Track(np.arange(5.0)[:, None] * np.ones((5, 6))))
    assert result.largest_of_frames.tolist() == [0, 1, 2, 3, 4]
    assert result.rms_of_frames == pytest.approx([0, 1, 2, 3, 4])
    assert result.rms == pytest.approx(np.sqrt(6))


def test_only_vertex_values_follow_the_decoded_vertex_order():
    values, places = np.array([[1.0, 2.0, 3.0]]), np.array([2, 0, 1])
    original = {"of vertices": Track(values), "of faces": Track(values, "face"),
                "other": Track(values)}  # fmt: skip
    decoded = {"of vertices": Track(values[:, [1, 2, 0]]), "of faces": Track(values, "face")}
    result = errors_of_tracks(original, decoded, {Domain.VERTEX: places})
    assert {name: one.largest for name, one in result.items()} == {"of vertices": 0, "of faces": 0}
    assert errors_of_tracks(original, decoded)["of vertices"].largest == 2


def test_rms_is_zero_without_error_and_infinite_with_an_infinite_one():
    track = zeros(2, 3)
    assert track_errors(track, track).rms == 0
    missing = track_errors(track, changed(track, (1, 1), np.nan))
    assert (missing.rms, missing.rms_of_frames[0]) == (np.inf, 0)


def test_missing_values_equal_only_missing_values():
    track = changed(zeros(2, 3, 2), (0, 1, 0), np.nan)
    assert track_errors(track, track).largest == 0
    assert track_errors(track, zeros(2, 3, 2)).largest == np.inf
    infinite = changed(zeros(2, 3, 2), (1, 1), np.inf)
    assert track_errors(infinite, infinite).largest == 0


def test_integers_are_compared_without_overflow():
    high = Track(np.full((1, 2), 250, np.uint8))
    assert track_errors(high, Track(np.full((1, 2), 3, np.uint8))).largest == 247


def test_compare_returns_the_errors_of_common_tracks():
    grid = waving_grid(4)
    one, other = (
        meshreel.MeshSequence(grid.vertices, grid.faces, tracks=tracks)
        for tracks in (
            {"heat": zeros(4, grid.n_verts, unit="K"), "more": zeros(4, grid.n_verts)},
            {"heat": changed(zeros(4, grid.n_verts, unit="K"), (3, 0), 2)},
        )
    )
    quality = meshreel.compare(one, other)
    assert list(quality.tracks) == ["heat"]
    assert quality.as_dict()["tracks"]["heat"]["largest_of_frames"] == [0, 0, 0, 2]


def test_compare_rejects_different_tracks_of_the_same_name():
    grid = waving_grid(4)
    one, other = (
        meshreel.MeshSequence(grid.vertices, grid.faces, tracks={"x": zeros(4, grid.n_verts, n)})
        for n in (1, 3)
    )
    with pytest.raises(InvalidInputError, match="track 'x' of the original is scalar of each"):
        meshreel.compare(one, other)


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_errors_of_tiny_and_huge_numbers_are_precise(scale):
    track = zeros(4, 6, 3)
    result = track_errors(track, changed(track, (2, 5), [3 * scale, 4 * scale, 0]))
    assert result.largest == pytest.approx(5 * scale)
    assert result.rms == pytest.approx(5 * scale / np.sqrt(24))
