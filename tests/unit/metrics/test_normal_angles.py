import math

import numpy as np
import pytest

from meshreel.metrics.normals import normal_angles

FLAT = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])  # normal +z
TRIANGLE = np.array([[0, 1, 2]], np.int32)


def hinge(y, z):
    """FLAT with the third corner at (0, y, z); its normal is (0, -z, y)."""
    decoded = FLAT.copy()
    decoded[0, 2] = [0, y, z]
    return decoded


@pytest.mark.parametrize(
    ("y", "z", "angle_deg"), [(0, 1, 90), (1, 1, 45), (-1, 0, 180), (1, -1, 45), (-1, 1, 135)]
)
def test_normal_angle_of_a_tilted_face_is_that_of_the_hinge(y, z, angle_deg):
    assert normal_angles(FLAT, hinge(y, z), TRIANGLE).mean_deg == pytest.approx(angle_deg)


def test_tiny_normal_angles_are_precise():
    result = normal_angles(FLAT, hinge(1, 1e-12), TRIANGLE).mean_deg
    assert result == pytest.approx(math.degrees(1e-12), rel=1e-9)


def test_mean_and_percentile_weight_frames_equally():
    # Angles 0 and 90: mean 45; the 95th percentile lies 0.95 of the way from 0 to 90.
    original, decoded = np.repeat(FLAT, 2, axis=0), np.concatenate([FLAT, hinge(0, 1)])
    result = normal_angles(original, decoded, TRIANGLE)
    assert (result.mean_deg, result.p95_deg) == pytest.approx((45, 85.5))


def test_degenerate_faces_are_omitted_and_counted():
    # Frame 0 sound in both; frame 1 flat to a line in the original, frame 2 in the decoded.
    original = np.concatenate([FLAT, hinge(0, 0), FLAT])
    decoded = np.concatenate([hinge(1, 1), FLAT, hinge(0, 0)])
    result = normal_angles(original, decoded, TRIANGLE)
    assert result.n_degenerate_face_frames == 2
    assert result.mean_deg == pytest.approx(45)


def test_angles_of_only_degenerate_faces_are_zero():
    result = normal_angles(hinge(0, 0), hinge(0, 0), np.array([[0, 1, 2], [0, 0, 1]], np.int32))
    assert (result.mean_deg, result.p95_deg, result.n_degenerate_face_frames) == (0, 0, 2)


@pytest.mark.parametrize(("height", "n_degenerate"), [(1.9e-14, 1), (2.1e-14, 0)])
@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_degeneracy_is_relative_to_the_diagonal(height, n_degenerate, scale):
    # Area height / 2 against 1e-14 of diag^2 = 1, and so at any scale.
    thin = scale * hinge(height, 0)
    assert normal_angles(thin, thin, TRIANGLE).n_degenerate_face_frames == n_degenerate


def test_degeneracy_is_relative_to_the_original():
    thin = np.concatenate([hinge(1e-10, 0), [[[1.0, 0, 0]]]], axis=1)
    larger = thin.copy()
    larger[0, 3] = 1e6
    assert normal_angles(thin, larger, TRIANGLE).n_degenerate_face_frames == 0
    assert normal_angles(larger, thin, TRIANGLE).n_degenerate_face_frames == 1


def test_faces_beyond_float64_are_counted_as_degenerate():
    assert normal_angles(FLAT, 1e300 * FLAT, TRIANGLE).n_degenerate_face_frames == 1
