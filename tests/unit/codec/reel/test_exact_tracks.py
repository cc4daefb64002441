"""Lossless tracks and missing values."""

import numpy as np
import pytest

import meshreel
from samples.meshes import quad_sheet
from samples.tracks import quad_sheet_with

RNG = np.random.default_rng(5)
TYPES = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"]


def n_items(domain):
    moving = quad_sheet(1)
    return moving.surface.n_items(meshreel.Domain(domain), moving.n_verts, moving.n_faces)


def assert_same_bits(found, expected):
    assert found.dtype == expected.dtype
    assert found.tobytes() == expected.tobytes()


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("domain", ["vertex", "face", "corner"])
def test_exact_tracks_are_lossless(dtype, domain):
    values = RNG.integers(0, 100, (12, n_items(domain), 2)).astype(dtype)
    if dtype[0] == "f":
        values[3, 1] = [np.nan, -np.inf]
        values[4, 2] = [-0.0, 1e-300 if dtype == "f8" else 1e-40]
    track = meshreel.Track(values, domain, "other")
    data = meshreel.encode(quad_sheet_with(x=track), tracks={"x": "exact"}, block_frames=5)
    assert_same_bits(meshreel.decode(data).tracks["x"].values, values)
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


def test_constant_integers_are_lossless_and_cost_almost_nothing():
    ids = np.tile(np.arange(n_items("face")) // 7, (12, 1)).astype(np.int32)
    ids[6:, :3] += 1
    data = meshreel.encode(quad_sheet_with(part=meshreel.Track(ids, "face")))
    np.testing.assert_array_equal(meshreel.decode(data).tracks["part"].values[..., 0], ids)
    assert meshreel.info(data).tracks[0].size_bytes < ids.nbytes / 12


@pytest.mark.slow
def test_missing_values_stay_missing_and_others_keep_their_bound():
    n_verts = n_items("vertex")
    heat = (300 + 20 * np.sin(np.arange(12)[:, None] / 3 + np.arange(n_verts) / 9)).astype("f4")
    heat[2:5, :7] = np.nan
    heat[:, 9] = np.nan
    for order in ("keep", "vertices"):
        data = meshreel.encode(
            quad_sheet_with(heat=heat), tracks={"heat": 0.5}, order=order, block_frames=7
        )
        result = meshreel.decode(data).tracks["heat"].values[..., 0]
        np.testing.assert_array_equal(np.isnan(result), np.isnan(heat))
        assert np.nanmax(np.abs(result - heat)) <= 0.5
    nothing = np.full((12, n_verts), np.nan, np.float32)
    data = meshreel.encode(quad_sheet_with(heat=nothing), tracks={"heat": "1%"})
    assert np.isnan(meshreel.decode(data).tracks["heat"].values).all()


def test_track_is_coded_exactly_when_that_is_smaller():
    noise = RNG.integers(0, 3, (12, n_items("vertex"))).astype(np.float64)
    data = meshreel.encode(quad_sheet_with(noise=noise), tracks={"noise": 1e-9})
    [track] = meshreel.info(data).tracks
    assert track.is_exact
    np.testing.assert_array_equal(meshreel.decode(data).tracks["noise"].values[..., 0], noise)
