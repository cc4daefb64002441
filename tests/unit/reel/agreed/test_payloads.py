import struct
from dataclasses import replace

import numpy as np
import pytest

from meshreel.codec.corrections import Corrections
from meshreel.entropy.coder import encode_integers
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
from meshreel.reel.agreed import payloads
from meshreel.reel.agreed.fields import MAX_TAP, N_TAPS, Layout


@pytest.mark.parametrize("n_frames", [1, 2, 8, 9, 50])
def test_times_come_back_when_written(n_frames):
    times = np.random.default_rng(4).integers(-300, 300, (n_frames, 15)).cumsum(axis=0)
    back = payloads.read_basis(payloads.write_basis(times), 5, n_frames)
    np.testing.assert_array_equal(back, times)


@pytest.mark.parametrize("order", ["C", "F"])
def test_times_given_stay_as_they_are_when_written(order):
    times = np.array(np.arange(90).reshape(30, 3) ** 2, order=order)
    before = times.copy()
    payloads.write_basis(times)
    np.testing.assert_array_equal(times, before)


def test_times_are_refused_when_bytes_are_missing():
    payload = payloads.write_basis(np.ones((40, 6), int))
    for size in (0, 1, len(payload) - 1):
        with pytest.raises(CorruptStreamError):
            payloads.read_basis(payload[:size], 2, 40)


def layout(ends=(1, 4), step=0.25, size=10):
    return Layout(np.float32(step), ends, size)


def some_taps(n_modes=4):
    return np.arange(n_modes * N_TAPS).reshape(n_modes, N_TAPS) - 3


@pytest.mark.parametrize("ends", [(4,), (1, 4), (1, 2, 3, 4)])
def test_layout_comes_back_when_written(ends):
    back, taps = payloads.read_layout(payloads.write_layout(layout(ends), some_taps()), 4)
    assert back == layout(ends)
    assert back.step.dtype == np.float32
    np.testing.assert_array_equal(taps, some_taps())


@pytest.mark.parametrize(
    ("ends", "step", "size"),
    [((3, 2), 1.0, 4), ((4, 4), 1.0, 4), ((5,), 1.0, 4), ((0, 4), 1.0, 4), ((3,), 1.0, 4),
     ((4,), 0.0, 4), ((4,), -1.0, 4), ((4,), np.nan, 4), ((4,), np.inf, 4),
     ((4,), payloads.MAX_STEP, 4), ((4,), 1.0, 0), ((4,), 1.0, payloads.MAX_STENCIL + 1)],
)  # fmt: skip
def test_layout_is_refused_when_it_contradicts_itself(ends, step, size):
    payload = payloads.write_layout(layout(ends, step, size), some_taps())
    with pytest.raises(CorruptStreamError, match="fields of 4 modes"):
        payloads.read_layout(payload, 4)


@pytest.mark.parametrize("n_groups", [0, payloads.MAX_COUNTS + 1])
def test_layout_is_refused_when_it_has_no_groups_or_too_many(n_groups):
    payload = payloads.write_layout(layout(tuple(range(1, n_groups + 1))), some_taps())
    with pytest.raises(CorruptStreamError, match=f"{n_groups} groups"):
        payloads.read_layout(payload, 4)


@pytest.mark.parametrize("tap", [-MAX_TAP - 1, MAX_TAP + 1])
def test_layout_is_refused_when_a_tap_is_beyond_its_range(tap):
    taps = some_taps()
    taps[2, 1] = np.sign(tap) * MAX_TAP
    payloads.read_layout(payloads.write_layout(layout(), taps), 4)
    taps[2, 1] = tap
    with pytest.raises(CorruptStreamError, match="tap"):
        payloads.read_layout(payloads.write_layout(layout(), taps), 4)


def test_layout_is_refused_when_bytes_are_missing_or_left_over():
    payload = payloads.write_layout(layout(), some_taps())
    for size in range(1, len(payload)):
        with pytest.raises(CorruptStreamError):
            payloads.read_layout(payload[:size], 4)
    with pytest.raises(CorruptStreamError):
        payloads.read_layout(payload + b"\0", 4)


def test_layout_is_refused_as_that_of_another_build_when_its_number_differs():
    payload = payloads.write_layout(layout(), some_taps())
    remedies = {0: "encode the original again", 3: "encode the original again"}
    for number in (0, 3, 6, 255):
        remedy = remedies.get(number, "upgrade meshreel")
        with pytest.raises(
            UnsupportedVersionError, match=f"layout {number}; this build reads 4 and 5; {remedy}$"
        ):
            payloads.read_layout(bytes([number]) + payload[1:], 4)


def test_layout_is_refused_as_that_of_another_build_when_only_its_number_is_known():
    for number in (3, 6):
        with pytest.raises(UnsupportedVersionError):
            payloads.read_layout(bytes([number]), 4)


def test_layout_comes_back_when_the_block_refers_to_another():
    referring = replace(layout(), reference=300)
    payload = payloads.write_layout(referring, some_taps())
    assert payloads.read_layout(payload, 4)[0] == referring


def test_layout_is_refused_when_a_block_refers_to_itself():
    payload = payloads.write_layout(replace(layout(), reference=1), some_taps())
    with pytest.raises(CorruptStreamError, match="refers to itself"):
        payloads.read_layout(payload[:1] + b"\0" + payload[2:], 4)


@pytest.mark.parametrize("size", [1, 2, 5])
def test_layout_is_refused_as_cut_off_when_it_refers_and_ends_in_its_first_fields(size):
    payload = payloads.write_layout(replace(layout(), reference=1), some_taps())
    with pytest.raises(TruncatedStreamError, match="cut off"):
        payloads.read_layout(payload[:size], 4)


@pytest.mark.parametrize("size", [0, 1, 4])
def test_layout_is_refused_as_cut_off_when_it_ends_in_its_first_fields(size):
    payload = payloads.write_layout(layout(), some_taps())
    with pytest.raises(TruncatedStreamError, match="cut off"):
        payloads.read_layout(payload[:size], 4)


def corrections(step=0.5):
    """Of a block of 9 frames of 20 vertices."""
    vertices = np.array([3, 3, 3, 7, 19, 19])
    frames = np.array([0, 1, 5, 8, 2, 3])
    offsets = np.arange(18).reshape(6, 3) - 9
    return Corrections(np.float32(step), vertices, frames, offsets)


def written_raw(step, n_corrected, columns):
    """A payload of corrections as it should never be written."""
    return b"".join(
        [
            struct.pack("<f", step),
            write_varint(n_corrected),
            write_varint(len(columns[2])),
            encode_integers([np.array(one) for one in columns], [0, 1, 2, 3, 3, 3]),
        ]
    )


def test_corrections_come_back_when_written():
    back = payloads.read_corrections(payloads.write_corrections(corrections()), 9, 20)
    assert back.step == np.float32(0.5)
    np.testing.assert_array_equal(back.vertices, corrections().vertices)
    np.testing.assert_array_equal(back.frames, corrections().frames)
    np.testing.assert_array_equal(back.offsets, corrections().offsets)


@pytest.mark.parametrize(("n_frames", "n_verts"), [(8, 20), (9, 19), (1, 3), (1, 1)])
def test_corrections_are_refused_when_the_block_is_smaller(n_frames, n_verts):
    with pytest.raises(CorruptStreamError):
        payloads.read_corrections(payloads.write_corrections(corrections()), n_frames, n_verts)


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, np.inf, payloads.MAX_STEP])
def test_corrections_are_refused_when_their_step_is_none(step):
    with pytest.raises(CorruptStreamError):
        payloads.read_corrections(payloads.write_corrections(corrections(step)), 9, 20)


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
        (1, [[3], [2], [0, 1], [1, 1], [0, 0], [0, 0]]),  # more than are announced
        (1, [[3], [0], [-1], [1], [0], [0]]),
        (1, [[3], [0], [9], [1], [0], [0]]),
        (1, [[3], [1], [4, -5], [1, 1], [0, 0], [0, 0]]),
        (3, [[3, 1, 1], NONE, [0, 0], [1, 1], [0, 0], [0, 0]]),  # fewer than vertices
    ],
)
def test_corrections_are_refused_when_they_contradict_themselves(n_corrected, columns):
    with pytest.raises(CorruptStreamError):
        payloads.read_corrections(written_raw(0.5, n_corrected, columns), 9, 20)


def test_corrections_are_refused_before_they_take_memory_when_too_many_are_announced():
    payload = struct.pack("<f", 0.5) + write_varint(1) + write_varint(2**60)
    with pytest.raises(CorruptStreamError, match="are announced, for 9 frames of 20"):
        payloads.read_corrections(payload, 9, 20)


def test_runs_of_equal_offsets_take_few_bytes_when_written():
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
