"""Tracks of corners that share values."""

from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel.encoding.shared_corners import equal_corners
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.tracks import Coding, Sharing
from meshreel.kernel.normals import surface_normals
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.surface import Surface
from meshreel.model.tracks import Track
from samples.c_reader import Decoder, File, Host
from samples.meshes import quad_sheet, waving_grid
from samples.streams import recorded, track_headers

TYPES = ["u1", "i2", "u4", "i8", "f4", "f8"]


def sheet(n_frames=10):
    """A sheet of polygons with an isolated vertex."""
    plain = quad_sheet(n_frames)
    vertices = np.concatenate([plain.vertices, plain.vertices[:, :1] + 1], axis=1)
    surface = Surface(face_sizes=plain.surface.face_sizes)
    return meshreel.MeshSequence(vertices, plain.faces, 25, surface=surface)


SHEET = sheet()
VERTICES = join_triangles(SHEET.surface.sizes(SHEET.n_faces), SHEET.faces)
N_POLYGONS = SHEET.surface.n_faces(SHEET.n_faces)
SIDE = np.repeat(np.arange(N_POLYGONS) > N_POLYGONS // 2, SHEET.surface.sizes(SHEET.n_faces))


def waves(n_items, n_columns=1):
    t, i, c = np.ogrid[: len(SHEET), :n_items, :n_columns]
    return (300 + 40 * np.sin(0.3 * t + 0.1 * i + c)).astype(np.float32)


def normals():
    """Normals of vertices, close to those of the surface; some are 0."""
    result = surface_normals(np.ascontiguousarray(SHEET.vertices), SHEET.faces)
    result[:, VERTICES] += [0.02, 0, -0.01]
    lengths = np.linalg.norm(result, axis=2, keepdims=True)
    return np.divide(result, lengths, out=result, where=lengths > 0).astype(np.float32)


def with_seams(of_vertices):
    """Values of corners, with a seam."""
    result = of_vertices[:, VERTICES].copy()
    result[:, SIDE] += result[:, SIDE] + result.dtype.type(3)
    return result


def coded(track, bound, **options):
    """A file with a track, and the track's header."""
    whole = meshreel.MeshSequence(
        SHEET.vertices, SHEET.faces, 25, surface=SHEET.surface, tracks={"x": track}
    )
    data = meshreel.encode(whole, tracks={"x": bound}, **options)
    [header] = track_headers(data)
    return data, header


def decoded(data):
    return meshreel.decode(data).tracks["x"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "values", "bound", "coding"),
    [
        ("other", waves(SHEET.n_verts, 2), "0.1%", Coding.MODES),
        ("other", np.rint(waves(SHEET.n_verts)).astype(np.int32), "exact", Coding.EXACT),
        ("normal", normals(), "0.5deg", Coding.ROTATIONS),
        ("velocity", 25 * np.gradient(SHEET.vertices, axis=0), "1%", Coding.CENTRAL),
    ],
)
def test_corners_without_seams_cost_as_much_as_vertices(kind, values, bound, coding):
    used = np.isin(np.arange(SHEET.n_verts), VERTICES)
    values = values.astype(np.float32) if values.dtype.kind == "f" else values
    values[:, ~used] = 0 if kind == "normal" else values[:, VERTICES[:1]]
    options = {"max_error": 1e-4}
    of_vertices, said = coded(Track(values, "vertex", kind), bound, **options)
    data, header = coded(Track(values[:, VERTICES], "corner", kind), bound, **options)
    assert (header.sharing, header.coding) == (Sharing.VERTICES, said.coding)
    assert said.coding is coding
    assert len(data) == len(of_vertices)
    np.testing.assert_array_equal(decoded(data).values, decoded(of_vertices).values[:, VERTICES])


def test_lossless_velocities_of_corners_cost_almost_nothing_when_they_are_differences():
    values = (25 * np.gradient(SHEET.vertices, axis=0)).astype(np.float32)[:, VERTICES]
    track = Track(values, "corner", "velocity")
    data, header = coded(track, "exact", lossless=True)
    assert (header.sharing, header.coding) == (Sharing.VERTICES, Coding.EXACT_CENTRAL)
    assert decoded(data).values.tobytes() == values.tobytes()
    assert meshreel.info(data).tracks[0].size_bytes < values.nbytes / 100


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("has_seams", [False, True])
def test_shared_values_of_corners_are_lossless(dtype, has_seams):
    of_vertices = np.rint(waves(SHEET.n_verts, 2) / 7).astype(dtype)
    values = with_seams(of_vertices) if has_seams else of_vertices[:, VERTICES]
    if dtype[0] == "f":
        odd = np.flatnonzero(VERTICES[5] == VERTICES)
        values[3, odd] = [np.nan, -np.inf]
        values[4, odd] = -0.0
        if has_seams:
            bits = values.view(f"u{dtype[1]}")
            bits[5, odd[0]] = np.array(np.nan, dtype).view(bits.dtype) + 1
            values[6, odd[1]] = 0.0
    data, header = coded(Track(values, "corner", "other"), "exact", block_frames=4)
    assert header.sharing is (Sharing.ROWS if has_seams else Sharing.VERTICES)
    result = decoded(data)
    assert (result.domain, result.dtype) == ("corner", values.dtype)
    assert result.values.tobytes() == values.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("block_frames", [None, 4])
def test_values_with_seams_are_within_their_bound_and_cost_less_than_those_of_corners(block_frames):
    values = with_seams(waves(SHEET.n_verts, 2))
    values[2, SIDE & (VERTICES[SIDE][0] == VERTICES)] = np.nan
    data, header = coded(Track(values, "corner"), 0.2, block_frames=block_frames)
    assert (header.sharing, header.is_exact) == (Sharing.ROWS, False)
    result = decoded(data).values
    np.testing.assert_array_equal(np.isnan(result), np.isnan(values))
    apart = np.linalg.norm(result.astype(float) - values, axis=2)
    assert 0.02 < np.nanmax(apart) <= 0.2
    first = np.flatnonzero(np.isin(np.arange(len(VERTICES)), np.arange(0, len(VERTICES), 2)))
    apart = values.copy()
    apart[:, first] += np.float32(0.01) * np.arange(len(first), dtype=np.float32)[:, None]
    other, header = coded(Track(apart, "corner"), 0.2, block_frames=block_frames)
    assert len(data) < len(other)


@pytest.mark.slow
def test_normals_with_seams_are_predicted_from_the_surface():
    values = normals()[:, VERTICES]
    values[:, SIDE, 1] *= -1
    data, header = coded(Track(values, "corner", "normal"), "0.5deg", max_error=1e-3, effort=5)
    assert (header.sharing, header.coding) == (Sharing.ROWS, Coding.ROTATIONS)
    cosines = np.einsum("tnc,tnc->tn", decoded(data).values.astype(float), values)
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() <= 0.5


def test_frames_read_separately_equal_the_decoded_whole():
    data, _ = coded(Track(with_seams(waves(SHEET.n_verts)), "corner"), 0.2, block_frames=4)
    whole = decoded(data).values
    with ReelFile(BytesIO(data)) as reel:
        np.testing.assert_array_equal(reel.track("x")[7], whole[7])
        np.testing.assert_array_equal(reel.track("x")[2:6], whole[2:6])
        assert reel.track("x").shape == (10, len(VERTICES), 1)


def test_hierarchy_is_cached_for_tracks_with_the_same_rows():
    values = with_seams(waves(SHEET.n_verts))
    tracks = {"x": Track(values, "corner"), "y": Track(-values, "corner")}
    whole = meshreel.MeshSequence(
        SHEET.vertices, SHEET.faces, 25, surface=SHEET.surface, tracks=tracks
    )
    data = meshreel.encode(whole, tracks=dict.fromkeys(tracks, 0.2))
    assert len({header.rows for header in track_headers(data)}) == 1

    def cached_bytes(*names):
        host = Host()
        with File(data, host) as file, Decoder(file) as decoder:
            for name in names:
                decoder.frames(1 + list(tracks).index(name))
            return sum(host.held.values())

    assert cached_bytes("x", "y") - cached_bytes("x") < (cached_bytes("x") - cached_bytes()) / 2


def test_corners_have_separate_values_when_all_differ():
    values = np.random.default_rng(2).random((10, len(VERTICES), 1)).astype(np.float32)
    for bound in (0.01, "exact"):
        data, header = coded(Track(values, "corner"), bound)
        assert (header.sharing, header.rows) == (Sharing.NONE, b"")
        assert np.abs(decoded(data).values - values).max() <= 0.01


def test_corners_have_separate_values_when_rows_take_more_bytes():
    """Faces are randomly 0 or 1: rows would repeat the value of a face at each of its corners."""
    grid = waving_grid(2, 20, 20)
    of_faces = np.random.default_rng(3).integers(0, 2, grid.n_faces).astype(np.uint8)
    values = np.repeat(np.tile(of_faces, (2, 1)), 3, axis=1)
    whole = meshreel.MeshSequence(grid.vertices, grid.faces, tracks={"x": Track(values, "corner")})
    data = meshreel.encode(whole, tracks={"x": "exact"})
    [header] = track_headers(data)
    assert header.sharing is Sharing.NONE
    assert decoded(data).values.tobytes() == whole.tracks["x"].values.tobytes()


def test_corners_are_separated_when_a_late_frame_differs():
    values = np.zeros((9, 6, 2))
    values[3, 4], values[8, 1] = [0, 1], [1, 0]
    groups = equal_corners(Track(values, "corner"), np.array([7, 7, 5, 7, 7, 5]))
    together = groups[:, None] == groups
    expected = np.eye(6, dtype=bool)
    expected[2, 5] = expected[5, 2] = expected[0, 3] = expected[3, 0] = True
    np.testing.assert_array_equal(together, expected)


def test_signs_of_zeros_and_bits_of_nan_separate_corners():
    values = np.array([[0.0, -0.0, np.nan, -np.nan, np.nan, 0.0]])
    groups = equal_corners(Track(values, "corner"), np.zeros(6, np.int64))
    assert len(set(groups.tolist())) == 4
    assert (groups[0], groups[2]) == (groups[5], groups[4])


def test_corners_of_live_frames_have_separate_values():
    values = waves(SHEET.n_verts)[:, VERTICES]
    data = recorded(SHEET.replace(tracks={"x": Track(values, "corner")}), block_frames=4)
    [header] = track_headers(data)
    assert header.sharing is Sharing.NONE
    assert np.abs(decoded(data).values - values).max() <= 0.002 * np.ptp(values[:4])


@pytest.mark.slow
def test_static_values_of_many_corners_are_decoded():
    grid = waving_grid(40, 30, 30)
    values = np.ones((40, 3 * grid.n_faces, 8), np.float32)
    whole = meshreel.MeshSequence(grid.vertices, grid.faces, tracks={"x": Track(values, "corner")})
    data = meshreel.encode(whole, tracks={"x": "exact"})
    [track] = meshreel.info(data).tracks
    assert track.size_bytes < 500
    np.testing.assert_array_equal(decoded(data).values, values)
