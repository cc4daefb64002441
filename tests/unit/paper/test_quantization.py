"""Eq. 10 of the paper, and bits of the rows that are kept."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.paper.quantization import (
    dequantize,
    quantize,
    step_for_all_rows,
    steps_for_each_row,
    uniform_step,
)


@pytest.mark.parametrize("bits", [2, 8, 16, 24])
def test_largest_value_takes_the_largest_integer_when_bits_are_given(bits):
    values = np.array([0.3, -5.0, 4.0]).reshape(3, 1, 1)
    integers = quantize(values, step_for_all_rows(values, bits))
    assert np.abs(integers).max() == 2 ** (bits - 1) - 1


def test_error_stays_within_half_a_step_when_dequantized():
    values = np.random.default_rng(0).normal(size=(3, 4, 1000))
    steps = step_for_all_rows(values, 9)
    error = np.abs(dequantize(quantize(values, steps), steps) - values).max()
    assert error <= 0.5 * float(steps[0]) * (1 + 1e-6)


def test_all_is_zero_when_the_values_are():
    values = np.zeros((3, 2, 5))
    steps = step_for_all_rows(values, 8)
    assert steps.tolist() == [0.0]
    assert not dequantize(quantize(values, steps), steps).any()


def test_rows_keep_their_own_steps_when_there_is_one_for_each():
    values = np.ones((3, 2, 4)) * [[1.0], [0.3]]
    steps = np.array([0.5, 0.1], np.float32)
    assert quantize(values, steps)[0, :, 0].tolist() == [2, 3]


def test_step_is_zero_when_no_bits_are_given():
    assert uniform_step(7.0, 0) == 0.0


def fading_rows(n_rows=6):
    """Rows whose magnitudes halve from one to the next."""
    values = np.random.default_rng(0).uniform(-1, 1, (3, n_rows, 500))
    values[0, :, 0] = 1.0
    return values * 0.5 ** np.arange(n_rows)[:, None]


def test_every_row_fills_its_bits_when_they_are_constant():
    values = fading_rows()
    integers = quantize(values, steps_for_each_row(values, 7))
    assert np.abs(integers).max(axis=(0, 2)).tolist() == [63] * 6


def test_integers_halve_with_the_magnitudes_when_the_step_is_shared():
    values = fading_rows()
    integers = quantize(values, step_for_all_rows(values, 8))
    assert np.abs(integers).max(axis=(0, 2)).tolist() == [127, 64, 32, 16, 8, 4]


def test_rows_are_left_out_when_their_bits_are_zero():
    values = fading_rows()
    integers = quantize(values, steps_for_each_row(values, [8, 0, 8, 0, 2, 2]))
    assert integers.any(axis=(0, 2)).tolist() == [True, False, True, False, True, True]


def test_steps_are_refused_when_bits_are_missing_for_a_row():
    with pytest.raises(InvalidInputError, match="bits lists 2 rows, but there are 6 modes"):
        steps_for_each_row(fading_rows(), [8, 8])
