"""Velocities and normals predicted from decoded positions."""

from io import BytesIO

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel.encoding import following_tracks, track_residuals
from meshreel.codec.reel.normative.expected import differences, expected_ranks, ranks_of
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.tracks import Coding, TrackHeader
from meshreel.kernel.normals import surface_normals
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track
from samples.meshes import quad_sheet
from samples.streams import recorded, track_headers
from samples.tracks import OF_SURFACES, given_places

RNG = np.random.default_rng(4)
FPS = 30.0


def velocities(vertices, coding):
    """Velocities by differences over time."""
    steps = FPS * np.diff(vertices.astype(np.float64), axis=0)
    if coding is Coding.CENTRAL:
        return FPS * np.gradient(vertices.astype(np.float64), axis=0)
    if coding is Coding.FORWARD:
        return np.concatenate([steps, steps[-1:]])
    return np.concatenate([steps[:1], steps])


def normals_of(sheet):
    positions = np.ascontiguousarray(sheet.vertices, np.float64)
    return surface_normals(positions, np.ascontiguousarray(sheet.faces, np.int32))


def with_tracks(sheet, **tracks):
    return meshreel.MeshSequence(
        sheet.vertices, sheet.faces, FPS, surface=sheet.surface, tracks=tracks
    )


def headers(data):
    return {header.name: header for header in track_headers(data)}


def bytes_of(data):
    return {track.name: track.size_bytes for track in meshreel.info(data).tracks}


def angles(one, other):
    apart = np.linalg.norm(one.astype(float) - other, axis=-1)
    return np.degrees(2 * np.arcsin(np.clip(apart / 2, 0, 1)))


@pytest.mark.slow
@pytest.mark.parametrize("coding", [Coding.BACKWARD, Coding.CENTRAL, Coding.FORWARD])
@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_velocities_are_predicted_by_matching_differences(coding, order):
    sheet = quad_sheet(14)
    values = velocities(sheet.vertices, coding)
    sequence = with_tracks(
        sheet, v=Track(values.astype(np.float32), kind="velocity"), plain=values.astype(np.float32)
    )
    data = meshreel.encode(sequence, max_error=0.001, order=order)
    track_headers = headers(data)
    assert (track_headers["v"].coding, track_headers["v"].rate) == (coding, FPS)
    assert track_headers["plain"].coding is Coding.MODES  # a vector of another kind
    assert bytes_of(data)["v"] < 0.7 * bytes_of(data)["plain"]
    decoded = meshreel.decode(data)
    places = given_places(order, sheet.vertices, decoded.vertices)
    apart = np.linalg.norm(decoded.tracks["v"].values - values[:, places], axis=2)
    assert apart.max() <= track_headers["v"].bound


def test_rate_is_estimated_for_another_unit_of_time():
    sheet = quad_sheet(14)
    values = velocities(sheet.vertices, Coding.CENTRAL) / 7.5
    sequence = with_tracks(sheet, v=Track(values, kind="velocity"))
    result = headers(meshreel.encode(sequence, max_error=0.001))["v"]
    assert (result.coding, result.rate) == (Coding.CENTRAL, pytest.approx(FPS / 7.5, rel=1e-6))


@pytest.mark.slow
@pytest.mark.parametrize("coding", [Coding.BACKWARD, Coding.CENTRAL, Coding.FORWARD])
def test_rate_is_estimated_in_short_blocks(coding):
    sheet = quad_sheet(14)
    values = velocities(sheet.vertices, coding)
    sequence = with_tracks(sheet, v=Track(values, kind="velocity"))
    data = meshreel.encode(sequence, lossless=True, block_frames=4, tracks={"v": "0.1%"})
    result = headers(data)["v"]
    assert (result.coding, result.rate) == (coding, FPS)
    apart = np.linalg.norm(meshreel.decode(data).tracks["v"].values - values, axis=2)
    assert apart.max() <= result.bound


@pytest.mark.parametrize("coding", [Coding.BACKWARD, Coding.CENTRAL, Coding.FORWARD])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("order", ["keep", "drop"])
def test_lossless_velocities_cost_almost_nothing_when_they_are_differences(coding, dtype, order):
    sheet = quad_sheet(14)
    vertices = sheet.vertices.astype(dtype)
    values = velocities(vertices, coding).astype(dtype)
    values[3, 2] = [np.nan, -np.inf, -0.0]
    sequence = meshreel.MeshSequence(
        vertices,
        sheet.faces,
        FPS,
        tracks={"v": Track(values, kind="velocity"), "plain": Track(values, kind="vector")},
    )
    data = meshreel.encode(sequence, lossless=True, order=order)
    header = headers(data)["v"]
    assert (header.coding, header.rate, header.is_exact) == (coding.as_exact, FPS, True)
    assert bytes_of(data)["v"] < 0.1 * bytes_of(data)["plain"]
    decoded = meshreel.decode(data)
    places = given_places(order, vertices, decoded.vertices)
    assert decoded.tracks["v"].values.tobytes() == values[:, places].tobytes()


def test_velocities_near_differences_are_lossless():
    sheet = quad_sheet(14)
    vertices = sheet.vertices * np.array(1e200)  # differences may overflow float32
    values = RNG.normal(size=vertices.shape) + velocities(sheet.vertices, Coding.CENTRAL)
    for scale, dtype in ((1.0, np.float32), (1e200, np.float64)):
        given = (values * scale).astype(dtype)
        sequence = meshreel.MeshSequence(
            vertices, sheet.faces, FPS, tracks={"v": Track(given, kind="velocity")}
        )
        data = meshreel.encode(sequence, lossless=True, block_frames=5)
        assert meshreel.decode(data).tracks["v"].values.tobytes() == given.tobytes()


def test_unrelated_velocities_are_not_predicted():
    sheet = quad_sheet(14)
    t, v = np.ogrid[:14, : sheet.n_verts]
    wind = np.stack(np.broadcast_arrays(np.sin(t + 0 * v), np.cos(2 * t + v / 9), 0 * t + v), 2)
    still = meshreel.MeshSequence(
        np.repeat(sheet.vertices[:1], 14, 0), sheet.faces, FPS, surface=sheet.surface
    )
    for one in (sheet, still):
        sequence = with_tracks(one, wind=Track(wind, kind="velocity"))
        assert headers(meshreel.encode(sequence))["wind"].coding is Coding.MODES


@pytest.mark.slow
def test_predicted_tracks_keep_missing_velocities():
    sheet = quad_sheet(14)
    values = velocities(sheet.vertices, Coding.BACKWARD)
    values[3:6, 5], values[:, 9], values[2, 4, 1] = np.nan, np.nan, np.nan
    data = meshreel.encode(
        with_tracks(sheet, v=Track(values, kind="velocity")), max_error=0.001, block_frames=5
    )
    result = meshreel.decode(data).tracks["v"].values
    assert headers(data)["v"].coding is Coding.BACKWARD
    np.testing.assert_array_equal(np.isnan(result), np.isnan(values))
    there = ~np.isnan(values).any(axis=2)
    apart = np.linalg.norm(result - values, axis=2)[there]
    assert apart.max() <= headers(data)["v"].bound


@pytest.mark.slow
@pytest.mark.parametrize("block_frames", [None, 5])
@pytest.mark.parametrize("domain", OF_SURFACES)
def test_normals_are_coded_as_rotations_of_surface_normals(domain, block_frames):
    sheet = quad_sheet(12)
    of_vertices = normals_of(sheet)
    sizes = sheet.surface.sizes(sheet.n_faces)
    values = {
        Domain.VERTEX: of_vertices,
        Domain.FACE: surface_normals(
            np.ascontiguousarray(sheet.vertices, np.float64),
            sheet.faces,
            np.repeat(np.arange(len(sizes), dtype=np.int32), sizes - 2),
        ),
        Domain.CORNER: of_vertices[:, sheet.faces.reshape(-1, 6)[:, [0, 1, 2, 5]].reshape(-1)],
    }[domain].astype(np.float32)
    sequence = with_tracks(sheet, n=Track(values, domain, "normal"), plain=Track(values, domain))
    data = meshreel.encode(
        sequence, max_error=0.001, block_frames=block_frames, tracks={"plain": np.radians(0.5)}
    )
    decoded = meshreel.decode(data).tracks["n"].values
    assert headers(data)["n"].coding is Coding.ROTATIONS
    assert bytes_of(data)["n"] < bytes_of(data)["plain"]
    assert angles(decoded, values).max() <= 0.5
    np.testing.assert_allclose(np.linalg.norm(decoded, axis=2), 1, atol=1e-6)


def test_predicted_tracks_keep_missing_normals():
    sheet = quad_sheet(12)
    vertices = np.concatenate([sheet.vertices, sheet.vertices[:, :1]], axis=1)
    values = np.concatenate([normals_of(sheet), np.zeros((12, 1, 3))], axis=1).astype(np.float32)
    values[4, 7] = np.nan
    sequence = meshreel.MeshSequence(
        vertices, sheet.faces, FPS, tracks={"n": Track(values, kind="normal")}
    )
    data = meshreel.encode(sequence, max_error=0.001)
    decoded = meshreel.decode(data).tracks["n"].values
    assert headers(data)["n"].coding is Coding.ROTATIONS
    assert np.all(decoded[:, -1] == 0)
    np.testing.assert_array_equal(np.isnan(decoded), np.isnan(values))


def disturbed(values, how):
    if how == "none where the surface has one":
        values[5, 8] = 0
    elif how == "opposite":
        values[5, 8] *= -1
    else:
        values[5, 8, 1] = np.nan
    return values


@pytest.mark.slow
@pytest.mark.parametrize("how", ["none where the surface has one", "opposite", "missing in part"])
def test_unreachable_normals_disable_prediction(how):
    sheet = quad_sheet(12)
    values = disturbed(normals_of(sheet).astype(np.float32), how)
    sequence = with_tracks(sheet, n=Track(values, kind="normal"))
    data = meshreel.encode(sequence, max_error=0.001)
    assert headers(data)["n"].coding is Coding.MODES
    decoded = meshreel.decode(data).tracks["n"].values
    assert np.all(decoded[5, 8] == 0) == (how == "none where the surface has one")


@pytest.mark.slow
@pytest.mark.parametrize("order", ["keep", "drop"])
def test_velocities_of_live_frames_are_predicted(order):
    sheet = quad_sheet(20)
    values = velocities(sheet.vertices, Coding.BACKWARD).astype(np.float32)
    sequence = with_tracks(sheet, v=Track(values, kind="velocity"))
    data = recorded(sequence, max_error=0.01, order=order, block_frames=6)
    assert headers(data)["v"].coding.has_rate
    decoded = meshreel.decode(data)
    places = given_places(order, sheet.vertices, decoded.vertices)
    apart = np.linalg.norm(decoded.tracks["v"].values - values[:, places], axis=2)
    assert apart.max() <= headers(data)["v"].bound


@pytest.mark.slow
def test_single_frames_of_a_predicted_track_equal_the_decoded_whole():
    sheet = quad_sheet(14)
    values = velocities(sheet.vertices, Coding.CENTRAL).astype(np.float32)
    sequence = with_tracks(
        sheet,
        v=Track(values, kind="velocity"),
        n=Track(normals_of(sheet).astype(np.float32), kind="normal"),
    )
    data = meshreel.encode(sequence, max_error=0.001, block_frames=4)
    whole = meshreel.decode(data)
    with ReelFile(BytesIO(data)) as reel:
        for name in ("v", "n"):
            assert headers(data)[name].coding.is_predicted
            for frame in (13, 0, 4, 7):
                np.testing.assert_array_equal(
                    reel.track(name)[frame], whole.tracks[name].values[frame]
                )


@pytest.mark.slow
def test_size_target_is_met_when_tracks_are_predicted():
    sheet = quad_sheet(14)
    values = velocities(sheet.vertices, Coding.CENTRAL).astype(np.float32)
    sequence = with_tracks(sheet, v=Track(values, kind="velocity"))
    finest = len(meshreel.encode(sequence, max_error=0.01))
    assert len(meshreel.encode(sequence, size=finest)) <= finest


def with_normals(sheet):
    return with_tracks(sheet, n=Track(normals_of(sheet).astype(np.float32), kind="normal"))


@pytest.mark.slow
@pytest.mark.parametrize("target", [{"quality": 20}, {"max_error": 1.0}, {"kg": 2.0}])
def test_positions_are_finer_when_that_saves_bytes_of_tracks(target, monkeypatch):
    sequence = with_normals(quad_sheet(14))
    data = meshreel.encode(sequence, **target, tracks={"n": "0.5deg"})
    monkeypatch.setattr(following_tracks, "MIN_TRACK_SHARE", np.inf)
    at_target = meshreel.encode(sequence, **target, tracks={"n": "0.5deg"})
    assert len(data) < len(at_target)
    result, coarser = (
        meshreel.compare(sequence, meshreel.decode(one)) for one in (data, at_target)
    )
    assert result.max_error_percent < coarser.max_error_percent
    assert max(result.tracks["n"].largest, coarser.tracks["n"].largest) <= 0.5
    alone = meshreel.encode(sequence, **target, tracks={"n": "drop"})
    np.testing.assert_array_equal(
        meshreel.decode(at_target).vertices, meshreel.decode(alone).vertices
    )


def test_requested_step_of_positions_is_kept():
    sequence = with_normals(quad_sheet(14))
    data, alone = (
        meshreel.decode(meshreel.encode(sequence, step=0.01, tracks=tracks))
        for tracks in ({}, {"n": "drop"})
    )
    np.testing.assert_array_equal(data.vertices, alone.vertices)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_ranks_of_floats_are_ordered_and_invertible(dtype):
    ends = np.array([-np.inf, -1e30, -1.0, -0.0, 0.0, 1e-30, 2.0, np.inf], dtype)
    ranks = ranks_of(ends)
    assert np.all(np.diff(ranks.astype(object)) > 0)


def test_non_finite_expected_values_are_0():
    header = TrackHeader("v", "", "velocity", Domain.VERTEX, np.dtype(np.float32), 1.0, (0.0,) * 3)
    result = expected_ranks(header, np.array([1e39, -np.inf, np.nan, 0.0]))
    np.testing.assert_array_equal(result, 0)


def test_fit_does_not_depend_on_pieces(monkeypatch):
    rng = np.random.default_rng(3)
    positions = rng.normal(size=(9, 50, 3))
    velocities = 24.0 * differences(Coding.CENTRAL, positions) + rng.normal(size=(9, 50, 3))
    velocities[2, 7] = np.nan
    results = []
    for at_once in (1 << 18, 40):
        monkeypatch.setattr(track_residuals, "MAX_VALUES_PER_TASK", at_once)
        fit = track_residuals.DifferenceFit()
        fit.add(velocities, positions)
        results.append(fit.best())
    (coding, rate), (coding_of_pieces, rate_of_pieces) = results
    assert coding is coding_of_pieces is Coding.CENTRAL
    assert rate_of_pieces == pytest.approx(rate, rel=1e-12)
