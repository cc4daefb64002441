import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.extent import Extent
from meshreel.rendering.views import (
    NAMED_VIEWS,
    View,
    guess_up,
    parse_view,
)


@pytest.mark.parametrize("name", NAMED_VIEWS)
def test_parse_view_returns_the_angles_of_a_name(name):
    assert parse_view(name, "z") == View("z", *NAMED_VIEWS[name])


def test_parse_view_returns_explicit_angles():
    assert parse_view("-20,35.5", "y") == View("y", -20.0, 35.5)


@pytest.mark.parametrize("text", ["behind", "1", "1,2,3", "a,b", ""])
def test_parse_view_lists_the_views_when_the_text_is_invalid(text):
    with pytest.raises(InvalidInputError, match="front, side, top or AZIMUTH,ELEVATION"):
        parse_view(text, "y")


@pytest.mark.parametrize(
    ("low", "high", "up"),
    [
        ((-1, 0, -1), (1, 2, 1), "y"),
        ((-1, -1, 0), (1, 1, 2), "z"),
        ((-1, -1, 0.05), (1, 1, 2), "z"),
        ((-1, 0, 0), (1, 2, 2), "y"),  # on both floors
        ((-1, -1, -1), (1, 1, 1), "y"),  # on neither
        ((0, 0, 0), (0, 0, 0), "y"),
    ],
)
def test_guess_up_is_z_when_the_mesh_is_only_on_that_floor(low, high, up):
    assert guess_up(Extent(np.array(low, float), np.array(high, float), 1.0)) == up


@pytest.mark.parametrize(("size", "aspect"), [((4, 1, 0), 4.0), ((1, 2, 0), 0.5)])
def test_view_aspect_is_that_of_a_rectangle_when_it_is_seen_from_the_front(size, aspect):
    corners = np.array([[x, y, 0.0] for x in (0, size[0]) for y in (0, size[1])])
    assert View("y", 0.0, 0.0).aspect([corners]) == pytest.approx(aspect, rel=0.01)


def test_view_aspect_is_one_when_all_vertices_are_one_point():
    assert View().aspect([np.zeros((3, 3))]) == 1
