"""Frames interpolated at a constant rate."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from samples.meshes import quad_sheet, waving_grid

TIMES = [0.0, 0.005, 0.01, 0.015, 0.0175]
"""States of a solver, whose last one ends the run."""

TRIANGLE = np.array([[0, 1, 2]])


def moving(times=TIMES, **changes):
    """Return a triangle that moves by 1000 per second from the time 0 on, with tracks."""
    seconds = np.asarray(times, float)[:, None, None]
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    normals = np.concatenate([np.cos(90 * seconds), 0 * seconds, np.sin(90 * seconds)], axis=2)
    tracks = {
        "heat": Track(np.repeat(300 + 100 * seconds, 3, axis=1), unit="K"),
        "up": Track(np.repeat(normals, 3, axis=1), kind="normal"),
        "state": Track(np.repeat(np.arange(len(times))[:, None], 3, axis=1)),
    }
    vertices = corners + 1000 * seconds * [1, 0, 0]
    timing = changes or {"times": times}
    return MeshSequence(vertices, TRIANGLE, tracks=tracks, **timing)


@pytest.fixture
def path(tmp_path):
    save(moving(), tmp_path / "a.npz")
    return tmp_path / "a.npz"


@pytest.mark.parametrize("rate", [200, 400, 1000, 57.5])
def test_frames_are_interpolated_at_the_rate(path, read, rate):
    result = read(path, resample=rate)
    times = np.arange(int(0.0175 * rate + 1e-6) + 1) / rate
    assert (result.n_frames, result.fps, result.start_s) == (len(times), rate, 0)
    frames = result.read(0, result.n_frames)
    np.testing.assert_allclose(frames[:, 0, 0], 1000 * times, atol=1e-9)
    np.testing.assert_allclose(result.extent.high[0], 1 + 1000 * times[-1])
    heat, up, state = (result.tracks[name].read(0, len(times)) for name in ("heat", "up", "state"))
    np.testing.assert_allclose(heat[:, 1, 0], 300 + 100 * times)
    np.testing.assert_allclose(np.linalg.norm(up, axis=2), 1)
    np.testing.assert_array_equal(state[:, 0, 0], np.searchsorted(TIMES, times + 1e-9) - 1)
    assert (state.dtype, result.tracks["heat"].unit) == (np.int64, "K")


def test_frames_at_their_times_stay_exact(path):
    original, result = load(path), load(path, resample=400)
    np.testing.assert_array_equal(result.vertices[[0, 2, 4, 6, 7]], original.vertices)


def test_note_says_what_was_done(path, notes):
    load(path, resample=200, notes=notes)
    assert notes == [
        "resampled 5 frames to 4 at 200 per second, up to 0.015 s; positions and values in between "
        "are interpolated; the last frame, at 0.0175 s, is after the last new one"
    ]


def test_start_and_rate_of_even_frames_are_used(tmp_path):
    save(moving([0, 0.1, 0.2], fps=10, start_s=4), tmp_path / "a.npz")
    result = load(tmp_path / "a.npz", resample=20)
    assert (result.n_frames, result.start_s) == (5, 4)
    np.testing.assert_allclose(result.vertices[:, 0, 0], [0, 50, 100, 150, 200])


def test_missing_values_are_missing_beside_a_new_frame(tmp_path):
    heat = np.array([[1.0, 1, 1], [2, np.nan, np.inf], [3, 3, 3]])
    sequence = moving([0, 1, 2], fps=1).replace(tracks={"heat": heat})
    save(sequence, tmp_path / "a.npz")
    values = load(tmp_path / "a.npz", resample=2).tracks["heat"].values[..., 0]
    np.testing.assert_array_equal(values[::2], heat)
    np.testing.assert_array_equal(values[1], [1.5, np.nan, np.inf])


def test_frames_are_held_where_the_faces_change(tmp_path, notes):
    grid, sheet = waving_grid(2), quad_sheet(2)
    times = {"times": [0, 0.3, 0.5, 0.6]}
    several = MeshSequence.of_segments([grid, sheet.replace(fps=25)]).replace(**times)
    save(several, tmp_path / "a.reel", lossless=True)
    result = load(tmp_path / "a.reel", resample=10)
    assert (result.n_frames, result.n_segments, result.starts) == (7, 2, (0, 5, 7))
    np.testing.assert_array_equal(result[3].vertices, grid.vertices[1])
    np.testing.assert_array_equal(result[4].vertices, grid.vertices[1])
    np.testing.assert_array_equal(result[5].vertices, sheet.vertices[0])
    assert load(tmp_path / "a.reel", resample=1.5, notes=notes).n_segments == 1
    assert "1 segment between two new frames left out" in notes[0]


def test_displaced_frames_are_resampled(tmp_path):
    moves = np.zeros((2, 3, 3))
    moves[1] = [0, 0, 8]
    save(moving([0, 1], fps=1).replace(tracks={"u": moves}), tmp_path / "a.npz")
    result = load(tmp_path / "a.npz", resample=4, displace="u")
    np.testing.assert_allclose(result.vertices[:, 0, 2], [0, 2, 4, 6, 8])


@pytest.mark.parametrize("rate", [0, -1, np.nan, np.inf])
def test_invalid_rate_is_refused(path, rate):
    with pytest.raises(InvalidInputError, match=r"must be|finite|0 or"):
        load(path, resample=rate)


@pytest.mark.parametrize("rate", [1e9, 1e300])
def test_too_many_frames_are_refused(path, rate):
    with pytest.raises(InvalidInputError, match=r"the limit is 1000000; choose a lower rate"):
        load(path, resample=rate)


def test_unknown_rate_of_the_input_is_refused(tmp_path):
    save(waving_grid(3).replace(fps=0), tmp_path / "a.npz")
    with pytest.raises(InvalidInputError, match=r"needs the frame rate of the input; .* with fps"):
        load(tmp_path / "a.npz", resample=20)
    assert load(tmp_path / "a.npz", resample=20, fps=10).n_frames == 5


def test_one_frame_stays(tmp_path):
    save(moving([2.0]), tmp_path / "a.npz")
    result = load(tmp_path / "a.npz", resample=30)
    assert (result.n_frames, result.fps, result.start_s) == (1, 30, 2)
