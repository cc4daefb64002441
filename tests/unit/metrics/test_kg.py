import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.metrics.kg import kg_error_percent


def test_kg_is_the_ratio_of_error_and_spread():
    # Two vertices at x = -1 and 1: ||G - E(G)||^2 = 2. Both shifted by 0.1: error^2 = 0.02.
    # 100 sqrt(0.02 / 2) = 10.
    original = np.array([[[-1.0, 0, 0], [1, 0, 0]]])
    assert kg_error_percent(original, original + np.array([0, 0.1, 0])) == pytest.approx(
        10, rel=1e-12
    )


def test_kg_pools_all_frames():
    # Spread^2 = 2 + 8 = 10; the second frame's vertices are 0.3 and 0.1 off: error^2 = 0.1.
    # 100 sqrt(0.1 / 10) = 10.
    original = np.array([[[-1.0, 0, 0], [1, 0, 0]], [[3, 0, 0], [7, 0, 0]]])
    decoded = original.copy()
    decoded[1] += [[0, 0, 0.3], [0.1, 0, 0]]
    assert kg_error_percent(original, decoded) == pytest.approx(10, rel=1e-12)


def test_kg_centers_each_frame(soup):
    original, decoded, _ = soup
    path = np.arange(len(original))[:, None, None] * np.array([7.0, -3, 2])
    moved = kg_error_percent(original + path, decoded + path)
    assert moved == pytest.approx(kg_error_percent(original, decoded), rel=1e-12)


def test_kg_of_equal_sequences_is_exactly_zero(soup):
    assert kg_error_percent(soup[0], soup[0].copy()) == 0


@pytest.mark.parametrize("scale", [1e-6, 3.7, 2.0**-900, 2.0**900])
def test_kg_is_invariant_to_scale(soup, scale):
    original, decoded, _ = soup
    scaled = kg_error_percent(original * scale, decoded * scale)
    assert scaled == pytest.approx(kg_error_percent(original, decoded), rel=1e-12)


def test_kg_is_precise_for_huge_offsets(soup):
    # Multiples of 2^-20 plus 2^30 are exact in float64, so only the metric can lose digits.
    original, decoded = (np.round(part * 2**20) / 2**20 for part in soup[:2])
    far = kg_error_percent(original + 2.0**30, decoded + 2.0**30)
    assert far == pytest.approx(kg_error_percent(original, decoded), rel=1e-12)


def test_kg_is_precise_for_errors_below_the_rounding_of_centered_positions():
    # Error 2^-60 at the vertex at the origin, which float64 holds; spread^2 = 2.
    original = np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    decoded = original.copy()
    decoded[0, 0, 1] = 2.0**-60
    expected = 100 * 2.0**-60 / np.sqrt(2)
    assert kg_error_percent(original, decoded) == pytest.approx(expected, rel=1e-12)


def test_kg_of_float32_inputs_is_computed_in_float64():
    original = np.array([[[-1.0, 0, 0], [1, 0, 0]]], np.float32)
    decoded = original + np.float32(2.0**-20)
    expected = 100 * 2.0**-20 * np.sqrt(3)  # error^2 = 2 * 3 * 2^-40 over spread^2 = 2
    assert kg_error_percent(original, decoded) == pytest.approx(expected, rel=1e-12)


def test_kg_of_equal_coincident_vertices_is_zero():
    original = np.full((3, 4, 3), 0.1)
    assert kg_error_percent(original, original.copy()) == 0


def test_kg_of_changed_coincident_vertices_is_infinite():
    original = np.full((3, 7, 3), 0.1) + np.arange(3)[:, None, None]
    decoded = original.copy()
    decoded[1, 2, 0] += 1
    assert kg_error_percent(original, decoded) == np.inf


def test_error_names_both_shapes():
    with pytest.raises(InvalidInputError, match=r"\(2, 4, 3\) and \(2, 5, 3\)"):
        kg_error_percent(np.zeros((2, 4, 3)), np.zeros((2, 5, 3)))


@pytest.mark.parametrize("shape", [(0, 4, 3), (2, 0, 3)])
def test_empty_arrays_are_rejected(shape):
    with pytest.raises(InvalidInputError, match="at least one frame and one vertex"):
        kg_error_percent(np.zeros(shape), np.zeros(shape))
