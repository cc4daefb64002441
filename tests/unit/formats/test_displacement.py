"""Meshes moved by a track of displacements."""

import re

import numpy as np
import pytest

import meshreel
from meshreel.codec.displaced import motion_notes
from meshreel.codec.options import config_of
from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.model.notes import Notes
from meshreel.model.tracks import Track
from meshreel.operations.encoding import encode_and_measure
from meshreel.operations.save import save
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
def test_a_track_moves_the_vertices_and_is_kept(path, read, choice, factor):
    rest, moved = load(path), read(path, displace=choice)
    expected = rest.vertices + factor * rest.tracks["displacement"].values
    np.testing.assert_allclose(moved.read(0, 3), expected, atol=1e-6)
    np.testing.assert_allclose(moved.extent.high, expected.max(axis=(0, 1)), atol=1e-6)
    assert list(moved.tracks) == ["displacement", "heat"]
    assert moved.surface.displaced_by == ("displacement", factor)
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


SMALL = 5e-4
"""Length of a displacement, as a share of that of the sheet: less than a bound of 0.1 % allows."""


@pytest.fixture
def small(tmp_path):
    """A file of a sheet with a displacement that swings in waves, which is small."""
    grid = still(12)
    wave = np.sin(grid.vertices[..., :1] * 3) * np.sin(np.arange(12))[:, None, None]
    values = SMALL * (wave * [0.2, 0, 1]).astype(np.float32)
    save(grid.replace(tracks={"u": Track(values, unit="m")}), tmp_path / "small.npz")
    return tmp_path / "small.npz"


@pytest.mark.parametrize("factor", [1, -20])
@pytest.mark.parametrize("options", [{"bound": 0.1}, {"max_error": 0.1}, {}])
@pytest.mark.filterwarnings("ignore:positions are off")
def test_a_displacement_is_within_a_share_of_its_own_range(small, tmp_path, options, factor):
    original = load(small)
    values = original.tracks["u"].values
    range_size = np.linalg.norm(np.ptp(values, axis=(0, 1)))
    data = meshreel.encode(load(small, displace=f"u:{factor}"), **options)
    decoded = meshreel.decode(data)
    share = 0.001 if options else 0.002
    assert np.linalg.norm(decoded.tracks["u"].values - values, axis=2).max() <= range_size * share
    if "bound" not in options:
        return
    # The positions show the motion, and the geometry before it comes back.
    moved = original.vertices + np.float32(factor) * values
    allowed = min(abs(factor) * range_size, meshreel.info(data).diagonal) / 1000
    assert np.linalg.norm(decoded.vertices - moved, axis=2).max() <= allowed + 1e-6
    save(decoded, tmp_path / "a.reel", lossless=True)
    back = load(tmp_path / "a.reel", displace=f"u:{-factor}")
    apart = np.linalg.norm(back.vertices - original.vertices, axis=2).max()
    assert apart <= allowed + abs(factor) * range_size / 1000 + 1e-6
    assert apart <= back.error_bound + 1e-6


def test_segments_share_the_smallest_bound_of_their_motions(small):
    large = load(small).tracks["u"].values * 1000
    two = load(small, displace="u")
    two += load(small).replace(tracks={"u": large}, start_s=two.n_frames / two.fps)
    data = meshreel.encode(two, bound=0.1)
    range_size = np.linalg.norm(
        np.ptp(two.segments[0].tracks["u"].read(0, two.segments[0].n_frames), axis=(0, 1))
    )
    info = meshreel.info(data)
    assert info.error_bound_percent / 100 * info.diagonal == pytest.approx(range_size / 1000)


def test_a_note_compares_an_error_with_the_motion(small):
    text = r"positions are off by up to 0.00.*, and u moves them by 0.00.*u:\d+.* bound of its own"
    with pytest.warns(match=text):
        meshreel.encode(load(small, displace="u"), max_error=0.1)
    notes = Notes()
    encode_and_measure(load(small, displace="u"), config_of(quality=50), None, notes)
    assert any(re.match(text, note) for note in notes)
    meshreel.encode(load(small, displace="u"), bound=0.1)  # without a warning
    moved = load(small, displace="u:-2")
    motion = 2 * np.linalg.norm(np.ptp(moved.tracks["u"].read(0, 12), axis=(0, 1)))
    for share, factors in ((0.09, []), (0.11, ["10"]), (1.5, ["100"])):
        assert re.findall(r"u:(\d+)", str(motion_notes(moved, share * motion))) == factors
    rest = still(u=np.ones((3, moved.n_verts, 3)))
    assert motion_notes(rest.replace(surface=moved.surface), 1.0) == []


@pytest.mark.parametrize(("scale", "offset"), [(1, 100), (-100, 0)])
def test_a_bound_below_the_rounding_of_positions_is_met_by_the_track(tmp_path, scale, offset):
    grid = still(4)
    values = (1e-6 * np.arange(4, dtype=np.float32))[:, None, None] * np.ones_like(grid.vertices)
    vertices = scale * grid.vertices + offset
    save(grid.replace(vertices=vertices, tracks={"u": values}), tmp_path / "a.npz")
    with pytest.warns(match="positions are off"):
        data = meshreel.encode(load(tmp_path / "a.npz", displace="u"), bound=0.1)
    decoded = meshreel.decode(data)
    apart = np.linalg.norm(decoded.tracks["u"].values - values, axis=2).max()
    assert apart <= np.linalg.norm(np.ptp(values, axis=(0, 1))) / 1000
    info = meshreel.info(data)
    roundings = 4 * np.spacing(np.abs(vertices).max())
    assert info.error_bound_percent / 100 * info.diagonal == pytest.approx(roundings, rel=0.1)


def test_a_note_suggests_the_option_for_a_mesh_that_does_not_move(path, notes):
    load(path, notes=notes)
    assert notes == [
        "the mesh does not move, and its track displacement may be its displacement; move it with "
        'displace="displacement"'
    ]


@pytest.mark.parametrize("case", ["moving", "two", "scalar", "other name"])
def test_no_note_without_a_likely_displacement(tmp_path, case, notes):
    values, rest = still().tracks["displacement"].values, still().vertices
    within_box = np.concatenate([rest[:1, ::-1], rest[1:]])
    sequence = {
        "moving": lambda: still(u=values).replace(vertices=within_box),
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
