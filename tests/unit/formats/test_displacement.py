"""Meshes moved by a track of displacements."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.save import save
from meshreel.model.tracks import Track
from samples.meshes import quad_sheet, waving_grid


def still(n_frames=3, **tracks):
    """Return a static sheet with tracks: by default an upward displacement, and its height."""
    grid = waving_grid(n_frames)
    rest = np.repeat(grid.vertices[:1], n_frames, axis=0)
    displacement = np.zeros((n_frames, grid.n_verts, 3), np.float32)
    displacement[:, :, 2] = np.arange(n_frames)[:, None]
    tracks = tracks or {"displacement": displacement, "heat": displacement[:, :, 2]}
    return grid.replace(vertices=rest, tracks=tracks)


@pytest.fixture
def path(tmp_path):
    save(still(), tmp_path / "a.npz")
    return tmp_path / "a.npz"


@pytest.mark.parametrize(("choice", "factor"), [("displacement", 1), ("displacement:-2.5", -2.5)])
def test_a_track_moves_the_vertices_and_is_dropped(path, read, choice, factor):
    rest, moved = load(path), read(path, displace=choice)
    expected = rest.vertices + factor * rest.tracks["displacement"].values
    np.testing.assert_allclose(moved.read(0, 3), expected, atol=1e-6)
    np.testing.assert_allclose(moved.extent.high, expected.max(axis=(0, 1)), atol=1e-6)
    assert list(moved.tracks) == ["heat"]
    assert moved.dtype == rest.dtype


def test_each_segment_is_moved(tmp_path):
    other = quad_sheet(1).replace(fps=25)
    other = other.replace(tracks={"u": np.ones((1, other.n_verts, 3), np.float32)})
    grid = still(2)
    whole = grid.replace(tracks={"u": grid.tracks["displacement"]}) + other
    save(whole.replace(fps=5), tmp_path / "a.reel", lossless=True)
    moved = load(tmp_path / "a.reel", displace="u")
    np.testing.assert_array_equal(moved[2].vertices, other.vertices[0] + 1)
    assert (moved.n_segments, moved.fps) == (2, 5)


def test_a_note_suggests_the_option_for_a_mesh_that_does_not_move(path, notes):
    load(path, notes=notes)
    assert notes == [
        "the mesh does not move, and its track displacement may be its displacement; move it with "
        'displace="displacement"'
    ]


@pytest.mark.parametrize("case", ["moving", "two", "scalar", "other name"])
def test_no_note_without_a_likely_displacement(tmp_path, case, notes):
    values = still().tracks["displacement"].values
    sequence = {
        "moving": lambda: waving_grid(3).replace(tracks={"u": values}),
        "two": lambda: still(u=values, disp=values),
        "scalar": lambda: still(u=values[:, :, :1]),
        "other name": lambda: still(flux=values),
    }[case]()
    save(sequence, tmp_path / "a.npz")
    load(tmp_path / "a.npz", notes=notes)
    assert notes == []


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ("displacment", "there is no track 'displacment'; did you mean 'displacement'"),
        ("heat", "displace takes a track of three numbers per vertex; heat has 1 per vertex"),
        ("displacement:0", "a factor other than 0, NAME:FACTOR; got displacement:0"),
        ("displacement:much", "a factor other than 0, NAME:FACTOR; got displacement:much"),
    ],
)
def test_invalid_choices_are_refused(path, choice, message):
    with pytest.raises(InvalidInputError, match=message):
        load(path, displace=choice)


def test_a_displacement_that_is_not_finite_is_refused(tmp_path):
    values = still().tracks["displacement"].values.copy()
    values[1, 4, 0] = np.nan
    save(still(u=Track(values)), tmp_path / "a.npz")
    with pytest.raises(InvalidInputError, match="a displacement of frame 1 is not finite"):
        load(tmp_path / "a.npz", displace="u")
