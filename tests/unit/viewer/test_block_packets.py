"""Blocks as the page plays them, against what the decoder gives."""

import zlib
from io import BytesIO

import numpy as np
import pytest

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.methods import METHOD_NAMES
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import CorruptStreamError
from meshreel.sequence import MeshSequence
from meshreel.viewer.block_packets import block_packet
from meshreel.viewer.modes import Modes, modes_of, n_fields
from samples.meshes import irregular_sequence, waving_grid
from samples.packets import all_played, largest_error, played, read_packet

NAMES = list(METHOD_NAMES)
FINE, ALLOWED = 2e-5, 1e-4
"""Diagonals that a vertex may be off: with int16 of full range, and in exported pages."""


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("make", [waving_grid, irregular_sequence])
def test_block_packet_plays_what_is_decoded_for_every_method(name, make):
    assert largest_error(encode(make(12), name)) < FINE


@pytest.mark.parametrize("name", NAMES)
def test_block_packet_plays_what_is_decoded_when_there_is_one_frame(name):
    assert largest_error(encode(irregular_sequence(1), name)) < FINE


@pytest.mark.parametrize("name", NAMES)
def test_block_packet_plays_what_is_decoded_when_blocks_are_short(name):
    data = encode(irregular_sequence(11), name, block_frames=4)
    assert len(all_played(data)[1]) == 3
    assert largest_error(data) < FINE


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_block_packet_has_the_vertices_as_they_go_out_whatever_the_order(order):
    grid = waving_grid(6, dtype=np.float64)
    shuffled = np.random.default_rng(1).permutation(grid.n_verts)
    sequence = MeshSequence(grid.vertices[:, np.argsort(shuffled)], shuffled[grid.faces])
    assert largest_error(encode(sequence, order=order, max_error=0.3)) < FINE


@pytest.mark.parametrize("offset", [1e7, -1e10])
def test_block_packet_keeps_its_digits_when_the_model_is_far_away(offset):
    sequence = waving_grid(5, dtype=np.float64)
    moved = MeshSequence(sequence.vertices + offset, sequence.faces)
    data = encode(moved, max_error=0.01)
    with ReelFile(BytesIO(data)) as reel:
        found = played(block_packet(reel.block(0)))
        expected = decode(data).vertices - np.array(reel.frame.origin)
        assert np.abs(found - expected).max() < FINE * reel.frame.scale


@pytest.mark.parametrize("size", [1e-20, 1e20])
def test_block_packet_plays_what_is_decoded_when_units_are_extreme(size):
    sequence = waving_grid(5, dtype=np.float64)
    data = encode(MeshSequence(sequence.vertices * size, sequence.faces))
    assert largest_error(data) < FINE


def test_block_packet_carries_corrections_when_an_error_was_promised():
    data = encode(irregular_sequence(20), max_error=1.0)
    _, (packet,) = all_played(data)
    header, arrays = read_packet(packet)
    starts = arrays["correction_starts"]
    assert (len(starts), starts[0], starts[-1]) == (21, 0, len(arrays["correction_values"]))
    assert starts[-1] > 0
    assert largest_error(data) < FINE
    assert header["n_frames"] == 20


def test_block_packet_begins_with_the_modes_of_the_stream_when_it_is_of_reel():
    data = encode(waving_grid(dtype=np.float64), step=1e-5)
    with ReelFile(BytesIO(data)) as reel:
        packet, origin = block_packet(reel.block(0)), np.array(reel.frame.origin)
    for n_modes in (1, 3, 6):
        expected = decode(data, n_modes=n_modes).vertices - origin
        np.testing.assert_allclose(played(packet, n_modes), expected, atol=2e-5)


@pytest.mark.parametrize("name", ["pca-qp", "v2v", "blocks", "gft"])
def test_first_modes_come_closer_the_more_there_are_when_axes_have_modes_of_their_own(name):
    data = encode(waving_grid(dtype=np.float64), name)
    with ReelFile(BytesIO(data)) as reel:
        packet, origin = block_packet(reel.block(0)), np.array(reel.frame.origin)
    n_modes = read_packet(packet)[0]["n_modes"]
    whole = decode(data).vertices - origin
    errors = [np.linalg.norm(played(packet, k) - whole) for k in range(1, n_modes + 1)]
    assert np.all(np.diff(errors) <= 1e-6 * np.linalg.norm(whole))


@pytest.mark.parametrize("name", NAMES)
def test_n_fields_is_what_a_packet_has_or_more_when_it_is_told_before(name):
    data = encode(irregular_sequence(9), name, block_frames=5)
    with ReelFile(BytesIO(data)) as reel:
        info = reel.info()
        for number in range(2):
            found = read_packet(block_packet(reel.block(number)))[0]["n_modes"]
            if name in ("pca-qs", "gft"):
                assert found <= n_fields(info, number)
            else:
                assert found == n_fields(info, number)


@pytest.mark.parametrize("name", NAMES)
def test_block_packet_stays_within_the_error_that_is_allowed_when_it_is_coarse(name):
    data = encode(irregular_sequence(12), name)
    assert largest_error(data, 9e-5) < ALLOWED


def test_block_packet_deflates_to_less_when_an_error_is_allowed():
    data = encode(waving_grid(40, 30, 40))
    sizes = {}
    for allowed in (0.0, 1e-5, 1e-4, 1e-3):
        _, (packet,) = all_played(data, allowed)
        sizes[allowed] = len(zlib.compress(packet))
        assert largest_error(data, allowed) < max(allowed, FINE)
    assert sizes[1e-3] < sizes[1e-4] < sizes[1e-5] <= sizes[0.0]
    assert sizes[1e-4] < 0.8 * sizes[0.0]


def test_frames_of_modes_are_those_decoded_when_a_file_is_cut_off():
    data = encode(irregular_sequence(11), block_frames=4)
    with ReelFile(BytesIO(data[:-200])) as reel:
        assert not reel.is_whole
        found = [played(block_packet(reel.block(n))) for n in range(len(reel.starts) - 1)]
        expected = reel[:] - np.array(reel.frame.origin)
        np.testing.assert_allclose(np.concatenate(found), expected, atol=FINE * reel.frame.scale)


def test_modes_of_refuses_when_fields_are_beyond_all_numbers():
    with ReelFile(BytesIO(encode(waving_grid(3)))) as reel:
        block = reel.block(0)
    block.modes.coefficients[0, 0, 0] = np.inf
    with pytest.raises(CorruptStreamError, match="frames 0:3 decode to positions beyond all"):
        modes_of(block)


def test_modes_multiply_to_frames_when_they_are_put_together():
    rng = np.random.default_rng(0)
    modes = Modes(rng.normal(size=(4, 7)), rng.normal(size=(5, 4, 3)))
    expected = np.einsum("kv,tka->atv", modes.fields, modes.weights)
    np.testing.assert_allclose(modes.frames(slice(1, 4)), expected[:, 1:4])
