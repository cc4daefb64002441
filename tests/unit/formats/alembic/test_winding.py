import numpy as np
import pytest

from meshreel.formats.alembic.winding import turned_corners

COUNTS = [np.array([3, 5, 4]), np.array([], np.int64), np.array([0, 3, 0])]


def test_turned_corners_begin_with_the_last_of_each_face_when_faces_differ_in_size():
    np.testing.assert_array_equal(turned_corners(np.array([3, 4], np.int32)), [2, 1, 0, 6, 5, 4, 3])


@pytest.mark.parametrize("counts", COUNTS)
def test_turned_corners_undo_themselves_when_applied_twice(counts):
    turned = turned_corners(counts)
    np.testing.assert_array_equal(turned[turned], np.arange(counts.sum()))
