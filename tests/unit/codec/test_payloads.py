import numpy as np
import pytest

from meshreel.codec import payloads
from meshreel.codec.pipeline import Quantized
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError


def quantized(*shape):
    integers = np.random.default_rng(8).integers(-900, 900, shape)
    return Quantized(integers, np.float32(0.125))


def test_anchor_vertices_come_back_when_written():
    anchors = np.array([0, 1, 5, 99])
    back = payloads.read_anchor_vertices(payloads.write_anchor_vertices(anchors), 100)
    np.testing.assert_array_equal(back, anchors)


@pytest.mark.parametrize("anchors", [[3, 3], [5, 2], [0, 100], [-1, 4]])
def test_anchor_vertices_are_refused_when_they_do_not_ascend_in_range(anchors):
    with pytest.raises(CorruptStreamError, match="ascending"):
        payloads.read_anchor_vertices(payloads.write_anchor_vertices(np.array(anchors)), 100)


@pytest.mark.parametrize(("n_frames", "n_modes"), [(3, 4), (3, 0), (0, 0)])
def test_block_is_refused_when_its_modes_do_not_fit_its_frames(n_frames, n_modes):
    with pytest.raises(CorruptStreamError):
        payloads.read_block(write_varint(n_frames) + write_varint(n_modes))


def test_basis_comes_back_when_written():
    basis = quantized(3, 4, 20)
    back = payloads.read_basis(payloads.write_basis(basis), 4, 20)
    np.testing.assert_array_equal(back.integers, basis.integers)
    assert back.step == basis.step


def test_basis_is_smaller_when_its_rows_are_smooth():
    phase = np.linspace(0, 9, 300)
    smooth = np.rint(3000 * np.sin(phase + np.arange(12)[:, None])).astype(int)
    shuffled = np.random.default_rng(0).permuted(smooth, axis=1)
    sizes = [
        len(payloads.write_basis(Quantized(rows.reshape(3, 4, 300), np.float32(1))))
        for rows in (smooth, shuffled)
    ]
    assert sizes[0] < 0.5 * sizes[1]


def test_anchors_and_coefficients_come_back_when_written():
    values = quantized(3, 5, 17)
    anchors = payloads.read_anchors(payloads.write_anchors(values), 5, 17)
    coefficients = payloads.read_coefficients(payloads.write_coefficients(values), 5, 17)
    np.testing.assert_array_equal(anchors.integers, values.integers)
    np.testing.assert_array_equal(coefficients.integers, values.integers)


@pytest.mark.parametrize("step", [np.nan, np.inf, -1.0])
def test_step_is_refused_when_it_is_not_a_positive_number(step):
    payload = payloads.write_anchors(Quantized(np.zeros((3, 1, 1), int), np.float32(step)))
    with pytest.raises(CorruptStreamError, match="step"):
        payloads.read_anchors(payload, 1, 1)


def test_step_is_refused_when_the_payload_ends_inside():
    with pytest.raises(TruncatedStreamError):
        payloads.read_anchors(b"\0\0", 1, 1)
