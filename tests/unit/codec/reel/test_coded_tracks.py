"""Tracks: within their bounds, live, lossless, and with missing values."""

from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel import Surface
from meshreel.codec.achieved import measure_stream
from meshreel.codec.reel.encoding import step_search
from meshreel.codec.reel.encoding.track_coders import (
    UNIT_LENGTH_TOLERANCE,
    TrackCoder,
    length_allowed,
)
from meshreel.codec.track_bounds import Measure, TrackBound
from meshreel.errors import InvalidInputError
from samples.meshes import irregular_sequence, quad_sheet, waving_grid
from samples.tracks import quad_sheet_with

RNG = np.random.default_rng(3)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def smooth(n_items, n_columns, n_frames=12, dtype=np.float32):
    """Waves over items and time, with noise."""
    t, i, c = np.ogrid[:n_frames, :n_items, :n_columns]
    waves = np.sin(0.3 * t + 0.1 * i + c) + 0.01 * RNG.normal(size=(n_frames, n_items, n_columns))
    return (300 + 40 * waves).astype(dtype)


def sizes():
    moving = quad_sheet(12)
    n_faces = moving.surface.n_faces(moving.n_faces)
    return moving.n_verts, n_faces, int(moving.surface.sizes(moving.n_faces).sum())


def over_space(places):
    """Smooth functions of positions of shape (T, N, 3)."""
    x, y, z = np.moveaxis(places.astype(float) / np.ptp(places), -1, 0)
    return np.stack([np.sin(3 * x + y), np.exp(-3 * y * y) + z], axis=-1).astype(np.float32)


@pytest.mark.parametrize("is_live", [False, True])
@pytest.mark.parametrize("order", ["keep", "drop"])
def test_smooth_functions_of_positions_take_few_bytes(order, is_live, monkeypatch):
    sheet = waving_grid(6, 24, 24)
    tracks = {"heat": over_space(sheet.vertices)}
    if order == "keep":
        centers = sheet.vertices[:, sheet.faces].mean(axis=2)
        tracks["flux"] = meshreel.Track(over_space(centers), "face")
    original = sheet.replace(tracks=tracks)
    bounds = dict.fromkeys(tracks, "0.5%")

    def sizes_of():
        if is_live:
            live = BytesIO()
            with meshreel.Encoder(
                original.faces, live, fps=25, tracks=bounds, order=order, block_frames=4
            ) as encoder:
                for number, frame in enumerate(original.vertices):
                    encoder.push(frame, original[number : number + 1].tracks)
            data = live.getvalue()
        else:
            data = meshreel.encode(original, tracks=bounds, order=order, block_frames=4)
        found = measure_stream(original, data).tracks
        for name, track in original.tracks.items():
            span = np.linalg.norm(np.ptp(track.values, axis=(0, 1)))
            assert found[name].largest <= 0.005 * span
        return np.array([track.size_bytes for track in meshreel.info(data).tracks])

    with_points = sizes_of()
    monkeypatch.setattr(step_search, "MAX_POINTS_RATIO", 1e-9)
    assert (with_points < 0.8 * sizes_of()).all()


def test_normals_have_length_one_and_are_within_their_angle():
    n_verts = sizes()[0]
    normals = unit(smooth(n_verts, 3, dtype=np.float64) - 300)
    normals[:, 4] = 0  # a vertex without a normal
    original = quad_sheet_with(n=meshreel.Track(normals, kind="normal"))
    result = meshreel.decode(meshreel.encode(original, tracks={"n": "2deg"})).tracks["n"].values
    assert np.all(result[:, 4] == 0)
    there = np.delete(result, 4, axis=1)
    np.testing.assert_allclose(np.linalg.norm(there, axis=2), 1, rtol=1e-12)
    cosines = np.sum(there * np.delete(normals, 4, axis=1), axis=2)
    turns = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    assert 0.5 < turns.max() <= 2


@pytest.mark.parametrize("degrees", [0.01, 0.5, 30])
def test_angle_bound_holds_for_slightly_short_normals(degrees):
    apart = length_allowed(TrackBound(Measure.ANGLE, degrees), 2.0)
    assert np.degrees(np.arcsin(apart / (1 - UNIT_LENGTH_TOLERANCE))) <= degrees


def test_colors_are_as_accurate_as_their_bits():
    n_verts = sizes()[0]
    colors = np.clip(smooth(n_verts, 4) / 400, 0, 1)
    original = quad_sheet_with(c=meshreel.Track(colors, kind="color"))
    result = meshreel.decode(meshreel.encode(original, tracks={"c": "6bit"})).tracks["c"].values
    assert np.abs(result - colors).max() <= 0.5 / 63


def test_dropping_tracks_gives_the_file_without_tracks():
    original = quad_sheet_with(heat=smooth(sizes()[0], 1))
    assert meshreel.encode(original, tracks={"heat": "drop"}) == meshreel.encode(quad_sheet_with())


REFUSED = {
    "no track 'heap'; did you mean 'heat'": {"heap": "1%"},
    "there is no track 'x'; there are heat, n, c": {"x": "1%"},
    "500K in its unit or one that converts to it, exact or drop; got '3Pa'": {"heat": "3Pa"},
}


@pytest.mark.parametrize("words", REFUSED)
def test_invalid_bounds_are_refused(words):
    n_verts = sizes()[0]
    original = quad_sheet_with(
        heat=meshreel.Track(smooth(n_verts, 1), unit="K"),
        n=meshreel.Track(unit(smooth(n_verts, 3)), kind="normal"),
        c=meshreel.Track(smooth(n_verts, 3) / 400, kind="color"),
    )
    with pytest.raises(InvalidInputError, match=words):
        meshreel.encode(original, tracks=REFUSED[words])


@pytest.mark.parametrize("is_live", [False, True])
def test_values_are_exact_if_their_number_type_is_coarser_than_the_bound(is_live):
    heat = (293 + 1e-4 * np.random.default_rng(0).random((11, GRID.n_verts))).astype("f4")
    if is_live:
        tracks = ({"heat": one} for one in heat)
        data = recorded(zip(GRID.vertices, tracks, strict=True), {"heat": "0.1%"})
    else:
        data = meshreel.encode(GRID.replace(tracks={"heat": heat}), tracks={"heat": "0.1%"})
    np.testing.assert_array_equal(meshreel.decode(data).tracks["heat"].values[..., 0], heat)


def test_values_that_cannot_meet_a_bound_are_refused():
    n_verts = sizes()[0]
    heat = smooth(n_verts, 1)
    heat[3, 5] = np.inf
    with pytest.raises(InvalidInputError, match=r"'heat' has inf at vertex 5, .*heat=exact"):
        meshreel.encode(quad_sheet_with(heat=heat))
    long = meshreel.Track(2 * unit(smooth(n_verts, 3)), kind="normal")
    with pytest.raises(InvalidInputError, match="must have length 1; vertex 0 has length 2"):
        meshreel.encode(quad_sheet_with(n=long))


def test_unsupported_tracks_are_refused():
    area = meshreel.Track(smooth(sizes()[1], 1), "face")
    with pytest.raises(InvalidInputError, match="order would be lost; keep it"):
        meshreel.encode(quad_sheet_with(area=area), order="drop")
    with pytest.raises(InvalidInputError, match=r"codes positions only; drop the tracks \(area\)"):
        meshreel.encode(quad_sheet_with(area=area), method="pca-qp")
    meshreel.encode(quad_sheet_with(area=area), method="pca-qp", tracks={"area": "drop"})


def test_few_different_integers_are_exact_where_that_takes_fewer_bytes():
    moving = waving_grid(40)
    contact = np.full((40, moving.n_verts), -2.0, np.float32)
    contact[:, RNG.permutation(moving.n_verts)[:20]] = 1.0
    contact[7:, 5] = np.nan
    sequence = moving.replace(tracks={"contact": contact})
    decoded = meshreel.decode(meshreel.encode(sequence, bound="0.1%"))
    np.testing.assert_array_equal(decoded.tracks["contact"].values[..., 0], contact)


@pytest.mark.parametrize(("n_frames", "n_tracks"), [(1, 12), (1, 2), (16, 12)])
def test_tracks_that_resemble_earlier_ones_take_fewer_bytes(n_frames, n_tracks, monkeypatch):
    sheet, rng = waving_grid(n_frames, 20, 20), np.random.default_rng(6)
    x, y, _ = np.moveaxis(sheet.vertices.astype(float), -1, 0)
    rough, tracks = np.abs(np.sin(x)) * rng.normal(size=(1, sheet.n_verts)), {}
    for number in range(n_tracks):  # twelve are more than a chain may have
        rough = rough + 0.2 * rng.normal(size=rough.shape)
        tracks[f"step {number}"] = (number * y + rough).astype("f4")
    original, sizes = sheet.replace(tracks=tracks), []
    for n_candidates in (step_search.MAX_CANDIDATES, 0):
        monkeypatch.setattr(step_search, "MAX_CANDIDATES", n_candidates)
        data = meshreel.encode(original, bound="0.5%", block_frames=8)
        errors = measure_stream(original, data).tracks
        infos = meshreel.info(data).tracks
        assert all(errors[track.name].largest <= track.bound for track in infos)
        sizes.append([sum(one.size_bytes for one in infos), infos[-1].size_bytes])
    assert (np.array(sizes[0]) < 0.96 * np.array(sizes[1])).all()


@pytest.mark.parametrize("n_columns", [1, 3])
def test_values_that_jump_are_coded_on_a_grid(n_columns, monkeypatch):
    moving = waving_grid(9, 20, 20)
    steps = np.random.default_rng(4).integers(0, 5, (1, moving.n_verts, n_columns))
    noise = 1e-3 * np.random.default_rng(5).random((9, moving.n_verts, n_columns))
    original = moving.replace(tracks={"plies": (0.3 * steps + noise).astype("f4")})
    found = []
    for grid in (TrackCoder.on_grid, None):
        monkeypatch.setattr(TrackCoder, "on_grid", grid)
        data = meshreel.encode(original, bound="0.3%")
        [track] = meshreel.info(data).tracks
        assert measure_stream(original, data).tracks["plies"].largest <= track.bound
        found.append(track.size_bytes)
    assert found[0] < 0.8 * found[1]


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_live_values_far_from_those_of_the_first_block_keep_their_bound(dtype):
    plies = np.random.default_rng(4).integers(0, 5, GRID.n_verts) * np.full((11, 1), 0.3)
    plies[5] *= 1e4
    plies = plies.astype(dtype)
    frames = zip(GRID.vertices, ({"plies": one} for one in plies), strict=True)
    result = meshreel.decode(recorded(frames, {"plies": "1e-4"}, block_frames=4)).tracks
    assert np.abs(result["plies"].values[..., 0].astype("f8") - plies).max() <= 1e-4


def test_constant_components_do_not_refine_the_grid_of_a_vector():
    moving = waving_grid(60)
    z = np.random.default_rng(2).normal(size=(60, moving.n_verts)).cumsum(axis=0)
    sizes_bytes = []
    for values in (z[..., None], np.stack([0 * z, 0 * z + 7, z], axis=-1)):
        data = meshreel.encode(moving.replace(tracks={"a": values}), bound=0.1)
        sizes_bytes.append(meshreel.info(data).tracks[0].size_bytes)
    assert sizes_bytes[1] < 1.02 * sizes_bytes[0]


def test_tracks_do_not_change_the_frames():
    moving = waving_grid(12)
    heat = smooth(moving.n_verts, 1)
    both = meshreel.MeshSequence(moving.vertices, moving.faces, tracks={"heat": heat})
    result = meshreel.decode(meshreel.encode(both, max_error=0.1))
    alone = meshreel.decode(meshreel.encode(moving, max_error=0.1))
    np.testing.assert_array_equal(result.vertices, alone.vertices)


def test_bounds_hold_for_any_values_on_any_mesh():
    odd = irregular_sequence()
    shape = odd.n_frames, odd.n_verts
    noise = np.random.default_rng(0).normal(size=shape)
    tracks = {"far": 1e12 + noise, "tiny": 1e-200 * noise, "huge": 1e200 * noise}
    tracks |= {"still": np.full(shape, 7.0), "wide": np.repeat(noise[..., None], 256, axis=2)}
    whole = meshreel.MeshSequence(odd.vertices, odd.faces, tracks=tracks)
    errors = meshreel.compare(whole, meshreel.encode(whole)).tracks
    for name in ("far", "tiny", "huge"):
        assert 0 < errors[name].largest <= 0.002 * np.ptp(tracks[name])
    assert errors["still"].largest == 0
    assert errors["wide"].largest <= 0.002 * 16 * np.ptp(noise)
    first = {name: values[:1] for name, values in tracks.items()}
    one = meshreel.MeshSequence(odd.vertices[:1], odd.faces, tracks=first)
    assert meshreel.compare(one, meshreel.encode(one)).tracks["far"].largest <= 0.01


GRID = waving_grid(11)
HEAT = (300 + 20 * np.sin(np.arange(11)[:, None] / 3 + np.arange(GRID.n_verts) / 20)).astype("f4")


def recorded(frames, bounds=None, **options):
    """Encode frames with tracks in chunks."""
    file = BytesIO()
    with meshreel.Encoder(GRID.faces, file, fps=25, tracks=bounds, **options) as encoder:
        for frame, tracks in frames:
            encoder.push(frame, tracks)
    return file.getvalue()


def test_frame_with_other_tracks_than_the_first_is_refused():
    with meshreel.Encoder(GRID.faces, BytesIO()) as encoder:
        encoder.push(GRID[0].vertices, {"heat": HEAT[0]})
        with pytest.raises(InvalidInputError, match="frame 1 has the tracks none; frame 0 has"):
            encoder.push(GRID[1].vertices)
        with pytest.raises(InvalidInputError, match="float64"):
            encoder.push(GRID[1].vertices, {"heat": HEAT[1].astype(float)})
        with pytest.raises(InvalidInputError, match="track 'heat': values of shape"):
            encoder.push(GRID[1].vertices, {"heat": HEAT[1][:-1]})
        encoder.push(GRID[1].vertices, {"heat": HEAT[1]})
        assert encoder.n_frames == 2


def test_bounds_of_unknown_tracks_are_refused_at_the_first_frame():
    encoder = meshreel.Encoder(GRID.faces, BytesIO(), tracks={"heap": 1})
    with pytest.raises(InvalidInputError, match="did you mean 'heat'"):
        encoder.push(GRID[0].vertices, {"heat": HEAT[0]})
    with meshreel.Encoder(GRID.faces, BytesIO(), method="pca-qp") as encoder:
        with pytest.raises(InvalidInputError, match="codes positions only"):
            encoder.push(GRID[0].vertices, {"heat": HEAT[0]})
        encoder.push(GRID[0].vertices)


INTEGERS = np.random.default_rng(5)
TYPES = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"]


def n_items(domain):
    moving = quad_sheet(1)
    return moving.surface.n_items(meshreel.Domain(domain), moving.n_verts, moving.n_faces)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("domain", ["vertex", "face", "corner"])
def test_exact_tracks_are_lossless(dtype, domain):
    values = INTEGERS.integers(0, 100, (12, n_items(domain), 2)).astype(dtype)
    if dtype[0] == "f":
        values[3, 1] = [np.nan, -np.inf]
        values[4, 2] = [-0.0, 1e-300 if dtype == "f8" else 1e-40]
    track = meshreel.Track(values, domain, "other")
    data = meshreel.encode(quad_sheet_with(x=track), tracks={"x": "exact"}, block_frames=5)
    found = meshreel.decode(data).tracks["x"].values
    assert (found.dtype, found.tobytes()) == (values.dtype, values.tobytes())
    [stored] = meshreel.info(data).tracks
    assert (stored.is_exact, stored.bound) == (True, 0)
    assert "exact" in str(stored)


@pytest.mark.parametrize("order", ["vertices", "drop"])
def test_exact_tracks_follow_the_order_of_vertices(order):
    ids = np.tile(np.arange(n_items("vertex"), dtype=np.int32), (12, 1))
    original = quad_sheet_with(id=ids)
    decoded = meshreel.decode(meshreel.encode(original, order=order))
    result = decoded.tracks["id"].values[0, :, 0]
    assert sorted(result) == list(range(len(result)))
    step = np.linalg.norm(np.ptp(original.vertices, axis=(0, 1))) / 100
    assert np.abs(decoded.vertices - original.vertices[:, result]).max() < step


def test_tracks_of_triangles_follow_the_order_of_faces():
    moving = waving_grid(6)
    ids = np.tile(RNG.permutation(moving.n_faces).astype(np.int32), (6, 1))
    areas = np.sin(ids / 50, dtype=np.float32)
    tracks = {"id": meshreel.Track(ids, "face"), "area": meshreel.Track(areas, "face")}
    original = moving.replace(tracks=tracks, surface=Surface(is_ordered=False))
    data = meshreel.encode(original, tracks={"area": 0.01}, max_error=0.001)
    assert meshreel.info(data).order == "drop"
    decoded = meshreel.decode(data)
    given = np.argsort(ids[0])[decoded.tracks["id"].values[0, :, 0]]
    centers, centers_hat = (one.vertices[0][one.faces].mean(axis=1) for one in (original, decoded))
    np.testing.assert_allclose(centers_hat, centers[given], atol=1e-3)
    errors = meshreel.compare(original, decoded).tracks
    assert errors["id"].largest == 0
    assert 0 < errors["area"].largest <= 0.01
    assert str(measure_stream(original, data).tracks) == str(errors)


def test_constant_integers_are_lossless_and_cost_almost_nothing():
    ids = np.tile(np.arange(n_items("face")) // 7, (12, 1)).astype(np.int32)
    ids[6:, :3] += 1
    data = meshreel.encode(quad_sheet_with(part=meshreel.Track(ids, "face")))
    np.testing.assert_array_equal(meshreel.decode(data).tracks["part"].values[..., 0], ids)
    assert meshreel.info(data).tracks[0].size_bytes < ids.nbytes / 12


def test_track_is_coded_exactly_when_that_is_smaller():
    noise = INTEGERS.integers(0, 1000, (12, n_items("vertex"))) / 64.0
    data = meshreel.encode(quad_sheet_with(noise=noise), tracks={"noise": 1e-6})
    [track] = meshreel.info(data).tracks
    assert track.is_exact
    np.testing.assert_array_equal(meshreel.decode(data).tracks["noise"].values[..., 0], noise)
