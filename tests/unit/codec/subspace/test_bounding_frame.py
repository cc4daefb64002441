import numpy as np
import pytest

from meshreel.codec.subspace.trajectories import BoundingFrame, stored_frame
from meshreel.model.extent import Extent


def test_numbers_in_single_precision_stay_near():
    frame = BoundingFrame((0.1, -2.7, 1e3 / 3), 12.3456789)
    rounded = frame.in_single_precision
    numbers = np.array([*rounded.origin, rounded.scale])
    assert (numbers == numbers.astype(np.float32)).all()
    np.testing.assert_allclose(rounded.origin, frame.origin, rtol=1e-7)
    assert frame.scale * (1 - 2e-7) < rounded.scale <= frame.scale


@pytest.mark.parametrize(
    "frame",
    [
        BoundingFrame((1e9 + 0.3, 0.0, 0.0), 1e-3),  # single precision has steps of 64 there
        BoundingFrame((0.0, 1e300, 0.0), 1e300),
        BoundingFrame((0.0, 0.0, 0.0), 1e-41),
    ],
)
def test_frames_far_away_huge_or_tiny_keep_double_precision(frame):
    assert frame.in_single_precision is frame


def test_points_keep_their_positions():
    point = np.array([0.1, -2.7, 1e3 / 3])
    assert stored_frame(Extent(point, point, 0.0)).origin == tuple(point)
    assert stored_frame(Extent(point, point + 1.0, 0.0)).origin != tuple(point + 0.5)
