"""Compressors of arrays meet their tolerance."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from track_peers import TRACK_PEERS

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
    if not peer.package.is_available:
        pytest.skip(f"needs {peer.package.name}")
    values = values_of(dtype)
    for tolerance in (0.3, 1e-2, 1e-4):
        back = peer.decode(peer.encode(values, tolerance), values.shape, dtype)
        assert back.dtype == dtype
        worst = np.abs(back.astype(float) - values).max()
        assert worst <= (1 if peer.name in BOUND_KEPT else 2) * tolerance * (1 + 1e-6) + 1e-6


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32])
@pytest.mark.parametrize("peer", TRACK_PEERS, ids=NAMES)
def test_lossless_mode_of_a_peer_preserves_every_bit(peer, dtype):
    if not peer.package.is_available:
        pytest.skip(f"needs {peer.package.name}")
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
