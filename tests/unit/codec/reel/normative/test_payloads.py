import struct
from dataclasses import replace

import numpy as np
import pytest

from meshreel.codec.bitstream.container import write_varint
from meshreel.codec.corrections import Corrections
from meshreel.codec.reel.normative import payloads
from meshreel.codec.reel.normative.fields import Layout
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from meshreel.kernel.basis import Rests
from meshreel.kernel.integers import encode_integers
from meshreel.kernel.mesh import MAX_STENCIL


@pytest.mark.parametrize("n_columns", [1, 3, 7])
@pytest.mark.parametrize("n_frames", [1, 2, 8, 9, 50])
def test_times_round_trip(n_columns, n_frames):
    times = np.random.default_rng(4).integers(-300, 300, (5, n_columns, n_frames)).cumsum(axis=2)
    back = payloads.read_basis(payloads.write_basis(times), 5, n_columns, n_frames)
    np.testing.assert_array_equal(back, times)


def test_resting_times_round_trip():
    times = np.random.default_rng(4).integers(-300, 300, (5, 3, 20))
    rests = Rests(((3, 9), (19, 20)), 2)
    back = payloads.read_basis(payloads.write_basis(times, rests), 5, 3, 20, rests=rests)
    np.testing.assert_array_equal(back, times)


def test_coefficients_of_cosines_round_trip():
    coded = np.random.default_rng(4).integers(-300, 300, (5, 3, 20))
    payload = payloads.write_basis(coded, has_cosines=True)
    np.testing.assert_array_equal(payloads.read_basis(payload, 5, 3, 20, has_cosines=True), coded)


def layout(step=0.25, size=10, n_learned=32, reference=0, is_single=False):
    return Layout(np.float32(step), size, n_learned, reference, is_single)


RESTING = replace(layout(reference=1), rests=Rests(((1, 2), (300, 900)), 8))
REUSED = replace(RESTING, n_reused=2, finer=np.float32(4.0))


@pytest.mark.parametrize(
    "known",
    [
        layout(),
        layout(n_learned=0),
        layout(size=1, reference=300),
        layout(is_single=True),
        RESTING,
        REUSED,
        replace(layout(is_single=True), has_cosines=True),
        replace(REUSED, is_adaptive=True),
    ],
)
def test_layout_round_trips(known):
    back = payloads.read_layout(payloads.write_layout(known))
    assert back == known
    assert back.step.dtype == np.float32


@pytest.mark.parametrize(
    ("step", "size", "n_learned"),
    [(0.0, 4, 4), (-1.0, 4, 4), (np.nan, 4, 4), (np.inf, 4, 4), (payloads.MAX_STEP, 4, 4),
     (1.0, 0, 4), (1.0, MAX_STENCIL + 1, 4), (1.0, 4, payloads.MAX_LEARNED + 1)],
)  # fmt: skip
def test_layout_beyond_the_limits_is_refused(step, size, n_learned):
    payload = payloads.write_layout(layout(step, size, n_learned))
    with pytest.raises(CorruptStreamError, match="invalid layout: stencils"):
        payloads.read_layout(payload)


@pytest.mark.parametrize("rests", [Rests(((0, 1),)), Rests(((1, 1),)), Rests(((1, 2),), 9)])
def test_layout_with_invalid_rests_is_refused(rests):
    payload = payloads.write_layout(replace(layout(), rests=rests))
    with pytest.raises(CorruptStreamError, match="resting times"):
        payloads.read_layout(payload)


@pytest.mark.parametrize("other", [RESTING, replace(layout(), is_adaptive=True)])
def test_layout_with_cosines_and_resting_or_adaptive_times_is_refused(other):
    with pytest.raises(CorruptStreamError, match="cosines"):
        payloads.read_layout(payloads.write_layout(replace(other, has_cosines=True)))


@pytest.mark.parametrize("known", [layout(), replace(layout(), rests=RESTING.rests)])
def test_layout_with_missing_or_trailing_bytes_is_refused(known):
    payload = payloads.write_layout(known)
    for size in range(1, len(payload)):
        with pytest.raises(CorruptStreamError):
            payloads.read_layout(payload[:size])
    with pytest.raises(CorruptStreamError):
        payloads.read_layout(payload + b"\0")


@pytest.mark.parametrize("number", [0, 6, 255])
def test_layout_of_a_newer_build_is_refused(number):
    payload = payloads.write_layout(layout())
    with pytest.raises(UnsupportedVersionError, match=f"layout {number}; .*; upgrade meshreel$"):
        payloads.read_layout(bytes([number]) + payload[1:])


@pytest.mark.parametrize("size", [0, 1, 2, 5, 6, 7])
def test_truncated_layout_is_refused(size):
    with pytest.raises(TruncatedStreamError, match="cut off"):
        payloads.read_layout(payloads.write_layout(layout())[:size])


def corrections(step=0.5):
    """Corrections of a block of 9 frames of 20 vertices."""
    vertices = np.array([3, 3, 3, 7, 19, 19])
    frames = np.array([0, 1, 5, 8, 2, 3])
    offsets = np.arange(18).reshape(6, 3) - 9
    return Corrections(np.float32(step), vertices, frames, offsets)


def written_raw(step, n_corrected, columns):
    """Encode invalid corrections."""
    return b"".join(
        [
            struct.pack("<f", step),
            write_varint(n_corrected),
            write_varint(len(columns[2])),
            encode_integers([np.array(one) for one in columns], [0, 1, 2, 3, 3, 3]),
        ]
    )


def test_corrections_round_trip():
    back = payloads.read_corrections(payloads.write_corrections(corrections()), 3, 9, 20)
    assert back.step == np.float32(0.5)
    np.testing.assert_array_equal(back.vertices, corrections().vertices)
    np.testing.assert_array_equal(back.frames, corrections().frames)
    np.testing.assert_array_equal(back.offsets, corrections().offsets)


@pytest.mark.parametrize(("n_frames", "n_verts"), [(8, 20), (9, 19), (1, 3), (1, 1)])
def test_corrections_of_a_larger_block_are_refused(n_frames, n_verts):
    with pytest.raises(CorruptStreamError):
        payloads.read_corrections(payloads.write_corrections(corrections()), 3, n_frames, n_verts)


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, np.inf, payloads.MAX_STEP])
def test_corrections_with_an_invalid_step_are_refused(step):
    with pytest.raises(CorruptStreamError):
        payloads.read_corrections(payloads.write_corrections(corrections(step)), 3, 9, 20)


NONE = [0, 0, 0]


@pytest.mark.parametrize(
    ("n_corrected", "columns"),
    [
        (2, [[3, 0], [0, 0], [0, 0], [1, 1], [0, 0], [0, 0]]),  # a vertex twice
        (2, [[3, -1], [0, 0], [0, 0], [1, 1], [0, 0], [0, 0]]),  # descending
        (1, [[-1], [0], [0], [1], [0], [0]]),
        (1, [[20], [0], [0], [1], [0], [0]]),
        (1, [[3], [-1], [0], [1], [0], [0]]),  # a vertex without corrections
        (2, [[3, 1], [1, -1], [0, 0], [1, 1], [0, 0], [0, 0]]),
        (1, [[3], [2], [0, 1], [1, 1], [0, 0], [0, 0]]),  # more than their total
        (1, [[3], [0], [-1], [1], [0], [0]]),
        (1, [[3], [0], [9], [1], [0], [0]]),
        (1, [[3], [1], [4, -5], [1, 1], [0, 0], [0, 0]]),
        (3, [[3, 1, 1], NONE, [0, 0], [1, 1], [0, 0], [0, 0]]),  # fewer than vertices
    ],
)
def test_contradictory_corrections_are_refused(n_corrected, columns):
    with pytest.raises(CorruptStreamError):
        payloads.read_corrections(written_raw(0.5, n_corrected, columns), 3, 9, 20)


def test_too_many_corrections_are_refused_before_allocation():
    payload = struct.pack("<f", 0.5) + write_varint(1) + write_varint(2**60)
    with pytest.raises(CorruptStreamError, match="do not fit 9 frames of 20 vertices"):
        payloads.read_corrections(payload, 3, 9, 20)


def test_runs_of_equal_offsets_take_few_bytes():
    frames = np.arange(500)
    nothing = np.zeros(500, np.int64)
    run, scattered = (
        Corrections(np.float32(1), nothing, frames, offsets)
        for offsets in (
            np.tile([700, -90, 33], (500, 1)),
            np.random.default_rng(0).integers(-700, 701, (500, 3)),
        )
    )
    sizes = [len(payloads.write_corrections(one)) for one in (run, scattered)]
    assert sizes[0] < 60 < 1000 < sizes[1]
