"""Eq. 10 of the paper."""

import numpy as np
import pytest

from meshreel.quantization.uniform import dequantize, quantize, uniform_step


@pytest.mark.parametrize("bits", [2, 8, 16, 24])
def test_largest_value_takes_the_largest_integer_when_bits_are_given(bits):
    values = np.array([0.3, -5.0, 4.0])
    assert np.abs(quantize(values, uniform_step(values, bits))).max() == 2 ** (bits - 1) - 1


def test_error_stays_within_half_a_step_when_dequantized():
    values = np.random.default_rng(0).normal(size=(3, 1000))
    step = uniform_step(values, 9)
    error = np.abs(dequantize(quantize(values, step), step) - values).max()
    assert error <= 0.5 * float(step) * (1 + 1e-6)


def test_all_is_zero_when_the_values_are():
    values = np.zeros((2, 5))
    step = uniform_step(values, 8)
    assert step == 0
    assert not dequantize(quantize(values, step), step).any()
