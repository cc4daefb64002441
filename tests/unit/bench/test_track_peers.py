"""Compressors of arrays meet their tolerance, and are compared at equal error."""

from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.runtime.extras import Extra
from track_peers import TRACK_PEERS, TrackPeer
from tracks import CLOSE_ENOUGH, TrackInput, coarsest_tolerance, limit_of, peer_bytes, rows

NAMES = [peer.name for peer in TRACK_PEERS]
BOUND_KEPT = {"sz3", "zfp", "pco"}


def values_of(dtype):
    """Waves and noise, of shape (12, 70, 3)."""
    rng = np.random.default_rng(0)
    at = np.linspace(0, 6, 70) + np.arange(12)[:, None] / 7
    waves = np.stack([np.sin(at), 3 + np.cos(at), at], axis=2)
    values = (waves + 0.01 * rng.normal(size=waves.shape)).astype(dtype)
    values.flags.writeable = False
    return values


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("peer", TRACK_PEERS, ids=NAMES)
def test_error_of_a_peer_is_within_its_tolerance(peer, dtype):
    if not peer.package.is_installed:
        pytest.skip(f"needs {peer.package.library}")
    values = values_of(dtype)
    for tolerance in (0.3, 1e-2, 1e-4):
        back = peer.decode(peer.encode(values, tolerance), values.shape, dtype)
        assert back.dtype == dtype
        worst = np.abs(back.astype(float) - values).max()
        assert worst <= (1 if peer.name in BOUND_KEPT else 2) * tolerance * (1 + 1e-6) + 1e-6


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32])
@pytest.mark.parametrize("peer", TRACK_PEERS, ids=NAMES)
def test_lossless_mode_of_a_peer_preserves_every_bit(peer, dtype):
    if not peer.package.is_installed:
        pytest.skip(f"needs {peer.package.library}")
    if not peer.is_reversible:
        pytest.skip("it always loses something")
    values = (1000 * values_of(float)).astype(dtype)
    if peer.name == "fpzip" and dtype is np.int32:
        with pytest.raises(InvalidInputError, match="takes float32 and float64; got int32"):
            peer.encode(values, 0.0)
        return
    assert np.array_equal(peer.decode(peer.encode(values, 0.0), values.shape, dtype), values)


def test_error_of_pcodec_states_that_steps_are_too_fine():
    peer = TRACK_PEERS[NAMES.index("pco")]
    with pytest.raises(InvalidInputError, match="too fine for integers of 32 bits"):
        peer.encode(values_of(float), 1e-12)


def encode_steps(values, tolerance):
    steps = np.rint(values / tolerance).astype(np.int16)
    return np.float64(tolerance).tobytes() + steps.tobytes()


def decode_steps(data, shape, dtype):
    steps = np.frombuffer(data[8:], np.int16).reshape(shape)
    return (steps * np.frombuffer(data[:8])[0]).astype(dtype)


STEPS = TrackPeer(
    name="steps", package=Extra("", "", ""), encode=encode_steps, decode=decode_steps,
    is_reversible=False,
)  # fmt: skip
"""Numbers quantized by the tolerance, with an error of half of it."""

WORSE = replace(
    STEPS, name="worse", is_reversible=True, encode=lambda values, tolerance: b"?",
    decode=lambda data, shape, dtype: np.full(shape, 1e6, dtype),
)  # fmt: skip


@pytest.fixture(scope="module")
def waving():
    flag = meshreel.simulate_flag(12, n_rows=8, n_columns=9)
    height = flag.vertices[..., 1].astype(np.float32)
    tracks = {"height": meshreel.Track(height, unit="m")}
    return meshreel.MeshSequence(flag.vertices, flag.faces, 25, "flag", tracks=tracks)


def test_row_has_the_bytes_of_the_track_in_a_stream(waving):
    [[name, bound, positions, size, steps, worse, share, *seconds]] = rows(
        waving, ["0.1%"], [STEPS, WORSE]
    )
    (track,) = meshreel.info(meshreel.encode(waving, tracks={"height": "0.1%"})).tracks
    plain = meshreel.encode(waving, tracks={"height": "drop"})
    assert (name, bound, positions, size) == ("height", "0.1%", len(plain), track.size_bytes)
    assert (steps, worse, share) == (1736, None, size / 1736)
    assert min(seconds) >= 0


def test_tolerance_is_close_to_the_bound(waving):
    tolerances = []

    def encode(values, tolerance):
        tolerances.append(tolerance)
        return encode_steps(values, tolerance)

    limit = limit_of("0.1%", waving.tracks["height"])
    assert limit == pytest.approx(1e-3 * np.ptp(waving.tracks["height"].values))
    peer_bytes(TrackInput(waving, "height"), replace(STEPS, encode=encode), limit)
    assert 1.5 * CLOSE_ENOUGH * limit < tolerances[-1] < 2.1 * limit


@pytest.mark.parametrize(
    ("peer", "limit", "message"),
    [
        (STEPS, 0.0, "no lossless mode"),
        (WORSE, 0.0, "its lossless mode changes"),
        (WORSE, 1.0, "no tolerance keeps errors"),
    ],
)
def test_peer_that_keeps_no_bound_is_refused(waving, peer, limit, message):
    with pytest.raises(InvalidInputError, match=message):
        peer_bytes(TrackInput(waving, "height"), peer, limit)


def test_limits_depend_on_the_kind_of_the_track(waving):
    unit = np.tile(np.float32([0, 0, 1]), (2, 5, 1))
    limits = [("normal", "2deg", 2), ("color", "6bit", 0.5 / 63), ("vector", "1%", 0)]
    for kind, text, limit in limits:
        assert limit_of(text, meshreel.Track(unit, kind=kind)) == limit
    assert limit_of("0.5m", waving.tracks["height"]) == 0.5
    assert limit_of("exact", waving.tracks["height"]) == 0
    with pytest.raises(InvalidInputError, match="dropped cannot be measured"):
        limit_of("drop", waving.tracks["height"])


def test_coarsest_tolerance_is_found_for_errors_in_powers_of_two():
    tried = []

    def largest_error(tolerance):
        tried.append(tolerance)
        return 0.1 * 2.0 ** np.floor(np.log2(tolerance))

    result = coarsest_tolerance(largest_error, 1.0, 1.0, 2.0)
    assert 8 <= result < 16
    assert len(tried) <= 5
