import numpy as np
import pytest

from meshreel.errors import CorruptStreamError, TruncatedStreamError
from meshreel.paper import payloads
from meshreel.paper.pipeline import Quantized


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


@pytest.mark.parametrize("n_steps", [1, 5])
def test_rows_come_back_when_written(n_steps):
    steps = np.arange(1, n_steps + 1).astype(np.float32)
    rows = Quantized(quantized(3, 5, 17).integers, steps)
    back = payloads.read_rows(payloads.write_rows(rows), 5, 17)
    np.testing.assert_array_equal(back.integers, rows.integers)
    np.testing.assert_array_equal(back.steps, steps)


@pytest.mark.parametrize("step", [np.nan, np.inf, -1.0])
def test_step_is_refused_when_it_is_not_a_positive_number(step):
    rows = Quantized(np.zeros((3, 1, 1), int), np.array([step], np.float32))
    with pytest.raises(CorruptStreamError, match="step"):
        payloads.read_rows(payloads.write_rows(rows), 1, 1)


def test_steps_are_refused_when_their_number_fits_no_row():
    rows = Quantized(np.zeros((3, 4, 1), int), np.ones(3, np.float32))
    with pytest.raises(CorruptStreamError, match="3 quantisation steps are announced for 4 rows"):
        payloads.read_rows(payloads.write_rows(rows), 4, 1)


def test_steps_are_refused_when_the_payload_ends_inside():
    with pytest.raises(TruncatedStreamError):
        payloads.read_rows(b"\1\0\0", 1, 1)
