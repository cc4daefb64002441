import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.arrays.named_arrays import Layout, find_layout, has_positions

FIRST, LAST = Layout.FRAMES_FIRST, Layout.FRAMES_LAST


@pytest.mark.parametrize(
    ("shape", "largest", "is_documented", "expected"),
    [
        ((7, 5, 3), 4, False, FIRST),
        ((5, 3, 7), 4, False, LAST),
        ((5, 3, 3), 4, False, LAST),  # vertex 4 needs more than three vertices
        ((5, 3, 3), 4, True, LAST),
        ((5, 3, 3), 2, False, FIRST),  # exactly three vertices, all used
        ((3, 3, 3), 2, True, FIRST),
        ((2, 3, 3), 2, False, FIRST),
    ],
)
def test_axis_of_three_or_faces_decide_the_layout(shape, largest, is_documented, expected):
    faces = np.array([[0, 1, largest]])
    assert find_layout(shape, faces, "x", is_documented=is_documented) is expected


@pytest.mark.parametrize(("shape", "largest"), [((3, 3, 3), 2), ((9, 3, 3), 1), ((2, 3, 3), 5)])
def test_ambiguous_layout_is_rejected(shape, largest):
    with pytest.raises(InvalidInputError, match=rf"up to {largest}: it may be \(T, V, 3\) or"):
        find_layout(shape, np.array([[0, 1, largest]]), "x", is_documented=False)


@pytest.mark.parametrize("shape", [(), (3,), (5, 3), (3, 5, 4), (5, 4, 2), (2, 5, 3, 3)])
def test_layout_without_an_axis_of_three_is_rejected(shape):
    with pytest.raises(
        InvalidInputError, match=r"x must have shape \(T, V, 3\) or \(V, 3, T\); got \("
    ):
        find_layout(shape, np.array([[0, 1, 2]]), "x", is_documented=True)
    assert not has_positions(shape)
