import numpy as np
import pytest

from meshreel.codec import payloads
from meshreel.codec.pipeline import Quantized
from meshreel.codec.reel import MAX_TAP, N_TAPS, Layout
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError


def quantized(*shape):
    integers = np.random.default_rng(8).integers(-900, 900, shape)
    return Quantized(integers, np.array([0.125], np.float32))


def test_anchor_vertices_come_back_when_written():
    anchors = np.array([0, 1, 5, 99])
    back = payloads.read_anchor_vertices(payloads.write_anchor_vertices(anchors), 100)
    np.testing.assert_array_equal(back, anchors)


@pytest.mark.parametrize("anchors", [[3, 3], [5, 2], [0, 100], [-1, 4]])
def test_anchor_vertices_are_refused_when_they_do_not_ascend_in_range(anchors):
    with pytest.raises(CorruptStreamError, match="ascending"):
        payloads.read_anchor_vertices(payloads.write_anchor_vertices(np.array(anchors)), 100)


@pytest.mark.parametrize(("n_frames", "n_modes"), [(0, 4), (3, 0), (0, 0)])
def test_block_is_refused_when_a_number_is_zero(n_frames, n_modes):
    with pytest.raises(CorruptStreamError):
        payloads.read_block(write_varint(n_frames) + write_varint(n_modes))


def test_basis_comes_back_when_written():
    basis = quantized(3, 4, 20)
    back = payloads.read_curves(payloads.write_curves(basis), 4, 20)
    np.testing.assert_array_equal(back.integers, basis.integers)
    np.testing.assert_array_equal(back.steps, basis.steps)


def test_basis_is_smaller_when_its_rows_are_smooth():
    phase = np.linspace(0, 9, 300)
    smooth = np.rint(3000 * np.sin(phase + np.arange(12)[:, None])).astype(int)
    shuffled = np.random.default_rng(0).permuted(smooth, axis=1)
    sizes = [
        len(payloads.write_curves(Quantized(rows.reshape(3, 4, 300), np.ones(1, np.float32))))
        for rows in (smooth, shuffled)
    ]
    assert sizes[0] < 0.5 * sizes[1]


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("n_steps", [1, 5])
def test_rows_come_back_when_written(shared, n_steps):
    steps = np.arange(1, n_steps + 1).astype(np.float32)
    rows = Quantized(quantized(3, 5, 17).integers, steps)
    back = payloads.read_rows(payloads.write_rows(rows, shared=shared), 5, 17, shared=shared)
    np.testing.assert_array_equal(back.integers, rows.integers)
    np.testing.assert_array_equal(back.steps, steps)


@pytest.mark.parametrize("step", [np.nan, np.inf, -1.0])
def test_step_is_refused_when_it_is_not_a_positive_number(step):
    rows = Quantized(np.zeros((3, 1, 1), int), np.array([step], np.float32))
    with pytest.raises(CorruptStreamError, match="step"):
        payloads.read_rows(payloads.write_rows(rows, shared=True), 1, 1, shared=True)


def test_steps_are_refused_when_their_number_fits_no_row():
    rows = Quantized(np.zeros((3, 4, 1), int), np.ones(3, np.float32))
    with pytest.raises(CorruptStreamError, match="3 steps are announced for 4 rows"):
        payloads.read_rows(payloads.write_rows(rows, shared=True), 4, 1, shared=True)


def test_steps_are_refused_when_the_payload_ends_inside():
    with pytest.raises(TruncatedStreamError):
        payloads.read_rows(b"\1\0\0", 1, 1, shared=True)


@pytest.mark.parametrize("n_frames", [1, 2, 8, 9, 50])
def test_times_come_back_when_written(n_frames):
    times = np.random.default_rng(4).integers(-300, 300, (n_frames, 15)).cumsum(axis=0)
    back = payloads.read_times(payloads.write_times(times), 5, n_frames)
    np.testing.assert_array_equal(back, times)


@pytest.mark.parametrize("order", ["C", "F"])
def test_times_given_stay_as_they_are_when_written(order):
    times = np.array(np.arange(90).reshape(30, 3) ** 2, order=order)
    before = times.copy()
    payloads.write_times(times)
    np.testing.assert_array_equal(times, before)


def test_times_are_refused_when_bytes_are_missing():
    payload = payloads.write_times(np.ones((40, 6), int))
    for size in (0, 1, len(payload) - 1):
        with pytest.raises(CorruptStreamError):
            payloads.read_times(payload[:size], 2, 40)


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
    for number in (0, payload[0] - 1, payload[0] + 1, 255):
        with pytest.raises(UnsupportedVersionError, match=f"{number:02x}"):
            payloads.read_layout(bytes([number]) + payload[1:], 4)
    with pytest.raises(UnsupportedVersionError):
        payloads.read_layout(b"", 4)
