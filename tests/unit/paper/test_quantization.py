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
def test_largest_value_takes_the_largest_integer(bits):
    values = np.array([0.3, -5.0, 4.0]).reshape(3, 1, 1)
    integers = quantize(values, step_for_all_rows(values, bits))
    assert np.abs(integers).max() == 2 ** (bits - 1) - 1


def test_dequantized_values_are_within_half_a_step():
    values = np.random.default_rng(0).normal(size=(3, 4, 1000))
    steps = step_for_all_rows(values, 9)
    error = np.abs(dequantize(quantize(values, steps), steps) - values).max()
    assert error <= 0.5 * float(steps[0]) * (1 + 1e-6)


def test_zeros_stay_zero():
    values = np.zeros((3, 2, 5))
    steps = step_for_all_rows(values, 8)
    assert steps.tolist() == [0.0]
    assert not dequantize(quantize(values, steps), steps).any()


def test_rows_can_have_separate_steps():
    values = np.ones((3, 2, 4)) * [[1.0], [0.3]]
    steps = np.array([0.5, 0.1], np.float32)
    assert quantize(values, steps)[0, :, 0].tolist() == [2, 3]


def test_step_without_bits_is_zero():
    assert uniform_step(7.0, 0) == 0.0


def fading_rows(n_rows=6):
    """Rows whose magnitudes halve from one to the next."""
    values = np.random.default_rng(0).uniform(-1, 1, (3, n_rows, 500))
    values[0, :, 0] = 1.0
    return values * 0.5 ** np.arange(n_rows)[:, None]


def test_constant_allocation_fills_the_bits_of_every_row():
    values = fading_rows()
    integers = quantize(values, steps_for_each_row(values, 7))
    assert np.abs(integers).max(axis=(0, 2)).tolist() == [63] * 6


def test_integers_of_a_shared_step_halve_with_the_magnitudes():
    values = fading_rows()
    integers = quantize(values, step_for_all_rows(values, 8))
    assert np.abs(integers).max(axis=(0, 2)).tolist() == [127, 64, 32, 16, 8, 4]


def test_rows_without_bits_are_omitted():
    values = fading_rows()
    integers = quantize(values, steps_for_each_row(values, [8, 0, 8, 0, 2, 2]))
    assert integers.any(axis=(0, 2)).tolist() == [True, False, True, False, True, True]


def test_missing_bits_of_a_row_are_refused():
    with pytest.raises(InvalidInputError, match="bits lists 2 rows, but there are 6 modes"):
        steps_for_each_row(fading_rows(), [8, 8])
