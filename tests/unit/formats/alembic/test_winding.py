import numpy as np
import pytest

from meshreel.formats.alembic.winding import reversed_corners

COUNTS = [np.array([3, 5, 4]), np.array([], np.int64), np.array([0, 3, 0])]


def test_reversed_corners_reverse_each_face():
    found = reversed_corners(np.array([3, 4], np.int32))
    np.testing.assert_array_equal(found, [2, 1, 0, 6, 5, 4, 3])


@pytest.mark.parametrize("counts", COUNTS)
def test_reversed_corners_are_their_own_inverse(counts):
    order = reversed_corners(counts)
    np.testing.assert_array_equal(order[order], np.arange(counts.sum()))
