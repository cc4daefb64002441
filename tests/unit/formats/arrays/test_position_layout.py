import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.arrays.position_layout import Layout, find_layout, has_positions

FIRST, LAST = Layout.FRAMES_FIRST, Layout.FRAMES_LAST


@pytest.mark.parametrize(
    ("shape", "largest", "is_documented", "expected"),
    [
        ((7, 5, 3), 4, False, FIRST),
        ((5, 3, 7), 4, False, LAST),
        ((5, 3, 3), 4, False, LAST),  # vertex 4 is not among three
        ((5, 3, 3), 4, True, LAST),
        ((5, 3, 3), 2, False, FIRST),  # three vertices, and all are used
        ((3, 3, 3), 2, True, FIRST),
        ((2, 3, 3), 2, False, FIRST),
    ],
)
def test_find_layout_follows_axis_and_faces_when_they_decide(
    shape, largest, is_documented, expected
):
    faces = np.array([[0, 1, largest]])
    assert find_layout(shape, faces, "x", is_documented=is_documented) is expected


@pytest.mark.parametrize(("shape", "largest"), [((3, 3, 3), 2), ((9, 3, 3), 1), ((2, 3, 3), 5)])
def test_find_layout_is_refused_when_faces_do_not_decide(shape, largest):
    with pytest.raises(InvalidInputError, match=rf"up to {largest}: that may be \(T, V, 3\) or"):
        find_layout(shape, np.array([[0, 1, largest]]), "x", is_documented=False)


@pytest.mark.parametrize("shape", [(), (3,), (5, 3), (3, 5, 4), (5, 4, 2), (2, 5, 3, 3)])
def test_find_layout_is_refused_when_no_axis_has_three(shape):
    with pytest.raises(InvalidInputError, match=r"x must have shape \(T, V, 3\); got \("):
        find_layout(shape, np.array([[0, 1, 2]]), "x", is_documented=True)
    assert not has_positions(shape)
