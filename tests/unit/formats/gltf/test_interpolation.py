import numpy as np
import pytest

from meshreel.formats.gltf.animation import CUBICSPLINE, INTERPOLATIONS, LINEAR, STEP, Curve, slerp

KEYS = np.array([1.0, 1.5, 3.0])
VALUES = np.array([[0.0, 1.0], [2.0, 1.0], [-1.0, 4.0]])
TIMES = np.array([0.0, 1.0, 1.25, 1.5, 2.0, 2.999, 3.0, 9.0])


def rotation(degrees, axis=(0, 0, 1)):
    half = np.radians(degrees) / 2
    return np.append(np.sin(half) * np.array(axis, float), np.cos(half))


def test_linear_curve_is_piecewise_linear():
    result = Curve(KEYS, VALUES, LINEAR).at(TIMES)
    expected = [np.interp(TIMES, KEYS, column) for column in VALUES.T]
    np.testing.assert_allclose(result, np.transpose(expected), rtol=0, atol=1e-15)


def test_curve_has_the_exact_values_at_keys():
    values = np.array([[0.1, 1 / 3], [1e9, 2e-9], [np.pi, -np.e]])
    for interpolation in (LINEAR, STEP):
        np.testing.assert_array_equal(Curve(KEYS, values, interpolation).at(KEYS), values)


def test_step_curve_is_constant_until_the_next_key():
    result = Curve(KEYS, VALUES, STEP).at(TIMES)
    np.testing.assert_array_equal(result, VALUES[[0, 0, 0, 1, 1, 1, 2, 2]])


def test_spline_curve_reproduces_a_cubic():
    def cubic(t):
        return np.stack([t**3 - 2 * t, 0.5 * t**2 + t], axis=1)

    slopes = np.stack([3 * KEYS**2 - 2, KEYS + 1], axis=1)
    curve = Curve(KEYS, cubic(KEYS), CUBICSPLINE, (slopes, slopes))
    times = np.linspace(1, 3, 41)
    np.testing.assert_allclose(curve.at(times), cubic(times), rtol=0, atol=1e-13)


def test_spline_curve_uses_out_and_in_tangents_of_the_interval():
    in_tangents, out_tangents = np.full((3, 1), 100.0), np.zeros((3, 1))
    in_tangents[1], out_tangents[0] = 4, 2
    curve = Curve(KEYS, np.zeros((3, 1)), CUBICSPLINE, (in_tangents, out_tangents))
    # Hermite at one half: an eighth of the interval times the difference of slopes.
    np.testing.assert_allclose(curve.at(np.array([1.25])), [[0.5 * (2 - 4) / 8]], atol=1e-15)


def test_curve_with_one_key_is_constant():
    curve = Curve(KEYS[:1], VALUES[:1], LINEAR)
    np.testing.assert_array_equal(curve.at(TIMES), np.repeat(VALUES[:1], len(TIMES), axis=0))


def test_curve_has_the_later_value_of_two_keys_at_one_time():
    curve = Curve(np.array([0.0, 1, 1, 2]), np.array([[0.0], [1], [5], [6]]), LINEAR)
    np.testing.assert_array_equal(curve.at(np.array([0.5, 1, 1.5])), [[0.5], [5], [5.5]])


@pytest.mark.parametrize("degrees", [1e-9, 1e-4, 1, 90, 179, 179.9999])
def test_slerp_rotates_at_constant_speed(degrees):
    weights = np.linspace(0, 1, 11)[:, np.newaxis]
    ends = np.tile(rotation(0), (11, 1)), np.tile(rotation(degrees), (11, 1))
    expected = np.array([rotation(degrees * one) for one in weights[:, 0]])
    np.testing.assert_allclose(slerp(*ends, weights), expected, rtol=0, atol=2e-12)


def test_slerp_takes_the_shorter_arc():
    result = slerp(rotation(0)[np.newaxis], -rotation(60)[np.newaxis], np.array([[0.5]]))
    np.testing.assert_allclose(result, [rotation(30)], rtol=0, atol=1e-15)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_rotation_curve_has_unit_quaternions(interpolation):
    values = np.array([rotation(0), rotation(80), -rotation(200)])
    tangents = (values, values) if interpolation == CUBICSPLINE else None
    result = Curve(KEYS, values, interpolation, tangents, is_rotation=True).at(TIMES)
    np.testing.assert_allclose(np.linalg.norm(result, axis=1), 1, rtol=0, atol=1e-15)
