"""Eq. 10 of the paper: bits of the rows that are kept."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.paper.quantization.allocation import step_for_all_rows, steps_for_each_row
from meshreel.paper.quantization.uniform import quantize


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
    with pytest.raises(InvalidInputError, match="bits lists 2 rows; 6 modes are kept"):
        steps_for_each_row(fading_rows(), [8, 8])
