import numpy as np
import pytest

from meshreel.formats.gltf.interpolation import Curve, Interpolation, slerp

KEYS = np.array([1.0, 1.5, 3.0])
VALUES = np.array([[0.0, 1.0], [2.0, 1.0], [-1.0, 4.0]])
TIMES = np.array([0.0, 1.0, 1.25, 1.5, 2.0, 2.999, 3.0, 9.0])


def turn(degrees, axis=(0, 0, 1)):
    half = np.radians(degrees) / 2
    return np.append(np.sin(half) * np.array(axis, float), np.cos(half))


def test_curve_is_on_straight_lines_when_linear():
    found = Curve(KEYS, VALUES, Interpolation.LINEAR).at(TIMES)
    expected = [np.interp(TIMES, KEYS, column) for column in VALUES.T]
    np.testing.assert_allclose(found, np.transpose(expected), rtol=0, atol=1e-15)


def test_curve_has_the_very_values_when_times_are_those_of_keys():
    values = np.array([[0.1, 1 / 3], [1e9, 2e-9], [np.pi, -np.e]])
    for interpolation in (Interpolation.LINEAR, Interpolation.STEP):
        np.testing.assert_array_equal(Curve(KEYS, values, interpolation).at(KEYS), values)


def test_curve_stays_until_the_next_key_when_it_steps():
    found = Curve(KEYS, VALUES, Interpolation.STEP).at(TIMES)
    np.testing.assert_array_equal(found, VALUES[[0, 0, 0, 1, 1, 1, 2, 2]])


def test_curve_is_the_cubic_when_tangents_are_those_of_one():
    def cubic(t):
        return np.stack([t**3 - 2 * t, 0.5 * t**2 + t], axis=1)

    slopes = np.stack([3 * KEYS**2 - 2, KEYS + 1], axis=1)
    curve = Curve(KEYS, cubic(KEYS), Interpolation.CUBICSPLINE, (slopes, slopes))
    times = np.linspace(1, 3, 41)
    np.testing.assert_allclose(curve.at(times), cubic(times), rtol=0, atol=1e-13)


def test_curve_uses_the_tangents_between_two_keys_when_they_differ_at_a_key():
    arriving, leaving = np.full((3, 1), 100.0), np.zeros((3, 1))
    arriving[1], leaving[0] = 4, 2
    curve = Curve(KEYS, np.zeros((3, 1)), Interpolation.CUBICSPLINE, (arriving, leaving))
    # Hermite at one half: an eighth of the way's length times the difference of slopes.
    np.testing.assert_allclose(curve.at(np.array([1.25])), [[0.5 * (2 - 4) / 8]], atol=1e-15)


def test_curve_stays_when_it_has_one_key():
    curve = Curve(KEYS[:1], VALUES[:1], Interpolation.LINEAR)
    np.testing.assert_array_equal(curve.at(TIMES), np.repeat(VALUES[:1], len(TIMES), axis=0))


def test_curve_takes_the_later_value_when_two_keys_are_at_one_time():
    curve = Curve(np.array([0.0, 1, 1, 2]), np.array([[0.0], [1], [5], [6]]), Interpolation.LINEAR)
    np.testing.assert_array_equal(curve.at(np.array([0.5, 1, 1.5])), [[0.5], [5], [5.5]])


@pytest.mark.parametrize("degrees", [1e-9, 1e-4, 1, 90, 179, 179.9999])
def test_slerp_turns_evenly_when_the_angle_is_any(degrees):
    share = np.linspace(0, 1, 11)[:, np.newaxis]
    ends = np.tile(turn(0), (11, 1)), np.tile(turn(degrees), (11, 1))
    expected = np.array([turn(degrees * one) for one in share[:, 0]])
    np.testing.assert_allclose(slerp(*ends, share), expected, rtol=0, atol=2e-12)


def test_slerp_goes_the_shorter_way_when_signs_are_opposite():
    found = slerp(turn(0)[np.newaxis], -turn(60)[np.newaxis], np.array([[0.5]]))
    np.testing.assert_allclose(found, [turn(30)], rtol=0, atol=1e-15)


@pytest.mark.parametrize("interpolation", Interpolation)
def test_curve_has_unit_quaternions_when_it_is_a_rotation(interpolation):
    values = np.array([turn(0), turn(80), -turn(200)])
    tangents = (values, values) if interpolation is Interpolation.CUBICSPLINE else None
    found = Curve(KEYS, values, interpolation, tangents, is_rotation=True).at(TIMES)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, rtol=0, atol=1e-15)
