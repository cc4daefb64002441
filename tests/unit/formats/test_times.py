"""Times of frames that are not evenly spaced, stored and interpolated at a constant rate."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from samples.meshes import quad_sheet, waving_grid

TIMES = [0, 0.005, 0.01, 0.015, 0.0175]
EXACT = {
    ".npz": None,
    ".reel": None,
    ".pvd": None,
    ".h5": "h5py",
    ".vtkhdf": "h5py",
    ".usda": "pxr",
    ".abc": "alembic3d",
}


def uneven():
    return waving_grid(5).replace(times=TIMES)


@pytest.mark.parametrize(("extension", "library"), EXACT.items(), ids=EXACT)
def test_times_come_back_exactly(tmp_path, extension, library, notes):
    if library:
        pytest.importorskip(library)
    path = tmp_path / f"a{extension}"
    save(uneven(), path, notes=notes)
    assert load(path, notes=notes).times.tolist() == TIMES
    assert not [note for note in notes if "time" in str(note)]


@pytest.mark.parametrize("extension", [".glb", ".mdd"])
def test_times_come_back_in_single_precision(tmp_path, extension, notes):
    written = save(uneven(), tmp_path / f"a{extension}", notes=notes)
    assert any(" stores times as float32, to which these are rounded" in note for note in notes)
    topology = {"topology": written[1]} if extension == ".mdd" else {}
    loaded = load(tmp_path / f"a{extension}", **topology)
    np.testing.assert_array_equal(loaded.times.astype(np.float32), np.float32(TIMES))


@pytest.mark.parametrize("extension", [".pvd", ".reel"])
def test_a_frame_rate_replaces_times(tmp_path, extension):
    save(uneven().replace(start_s=2.0), tmp_path / f"a{extension}")
    loaded = load(tmp_path / f"a{extension}", fps=10)
    assert loaded.times.tolist() == pytest.approx([2.0, 2.1, 2.2, 2.3, 2.4])


def test_a_note_says_that_a_format_has_a_rate_only(tmp_path, notes):
    save(uneven(), tmp_path / "a.pc2", notes=notes)
    assert any("PC2 has no frame times" in str(note) for note in notes)


def test_times_that_do_not_fit_the_frames_are_refused(tmp_path):
    grid = waving_grid(3)
    np.savez(tmp_path / "a.npz", vertices=grid.vertices, faces=grid.faces, times=[0.0, 1.0])
    with pytest.raises(ValueError, match=r"times must have shape \(3,\)"):
        load(tmp_path / "a.npz")


def test_times_cross_changes_of_faces(tmp_path):
    whole = waving_grid(3).replace(times=[0, 1, 3]) + quad_sheet(2).replace(times=[4, 4.5])
    save(whole, tmp_path / "a.pvd")
    loaded = load(tmp_path / "a.pvd")
    assert (loaded.n_segments, loaded.times.tolist()) == (2, [0, 1, 3, 4, 4.5])
    assert loaded[2:4].times.tolist() == [3, 4]


def test_single_frames_of_changing_faces_keep_their_times(tmp_path):
    meshes = [waving_grid(1), quad_sheet(1), waving_grid(1)]
    parts = [mesh.replace(times=[time]) for mesh, time in zip(meshes, [0, 1, 5], strict=True)]
    whole = parts[0] + parts[1] + parts[2]
    assert whole.times is None  # without a rate, single frames have no times
    save(whole.replace(times=[0, 1, 5]), tmp_path / "a.pvd")
    assert load(tmp_path / "a.pvd").times.tolist() == [0, 1, 5]


UNEVEN = [0.0, 0.005, 0.01, 0.015, 0.0175]
"""States of a solver, whose last one ends the run."""

TRIANGLE = np.array([[0, 1, 2]])


def moving(times=UNEVEN, **changes):
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
    np.testing.assert_array_equal(state[:, 0, 0], np.searchsorted(UNEVEN, times + 1e-9) - 1)
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
