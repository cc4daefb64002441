import numpy as np
import pytest

from meshreel.metrics.displacement import displacement_errors_percent
from meshreel.metrics.reference import bounding_box_reference

# Two frames of two vertices; the box of both frames together is 3 x 4 x 12, its diagonal 13.
ORIGINAL = np.array([[[0.0, 0, 0], [3, 0, 0]], [[0, 4, 0], [0, 0, 12]]])


def test_displacement_is_in_percent_of_the_whole_diagonal():
    decoded = ORIGINAL.copy()
    decoded[1, 0] += [0.3, 0, 0.4]  # 0.5 long: 100 * 0.5 / 13; RMS sqrt(0.25 / 4) = 0.25
    errors = displacement_errors_percent(ORIGINAL, decoded)
    assert errors.max_percent == pytest.approx(50 / 13, rel=1e-12)
    assert errors.rms_percent == pytest.approx(25 / 13, rel=1e-12)


def test_displacement_of_equal_sequences_is_exactly_zero():
    errors = displacement_errors_percent(ORIGINAL, ORIGINAL.copy())
    assert (errors.rms_percent, errors.max_percent) == (0, 0)


@pytest.mark.parametrize("decoded_x", [0.0, 1.0])
def test_displacement_from_a_single_point_is_zero_or_infinite(decoded_x):
    decoded = np.zeros((2, 3, 3))
    decoded[1, 1, 0] = decoded_x
    errors = displacement_errors_percent(np.zeros((2, 3, 3)), decoded)
    expected = np.inf if decoded_x else 0
    assert (errors.rms_percent, errors.max_percent) == (expected, expected)


def test_displacement_beyond_float64_is_infinite():
    decoded = ORIGINAL.copy()
    decoded[0, 0, 0] = 1e300
    assert displacement_errors_percent(ORIGINAL, decoded).max_percent == np.inf


@pytest.mark.parametrize("scale", [1e-300, 1e-6, 1.0, 1e100, 1e300])
def test_reference_diagonal_scales_with_the_box(scale):
    diagonal = bounding_box_reference(ORIGINAL * scale).diagonal
    assert diagonal == pytest.approx(13 * scale, rel=1e-14)


def test_reference_diagonal_is_exact_for_huge_offsets():
    assert bounding_box_reference(ORIGINAL + 2.0**40).diagonal == pytest.approx(13, rel=1e-14)
