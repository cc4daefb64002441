"""Looks of tracks: valid and invalid components, ranges and color maps."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.model.tracks import Track
from meshreel.rendering.track_colors import TrackColors, TrackLook

SCALAR = Track(np.zeros((2, 5), np.float32))
VECTOR = Track(np.zeros((2, 5, 3), np.float32), kind="vector")
TENSOR = Track(np.zeros((2, 5, 9), np.float32))
COLOR = Track(np.zeros((2, 5, 3), np.uint8), kind="color")


@pytest.mark.parametrize(
    ("track", "options", "title"),
    [
        (SCALAR, {}, "u"),
        (SCALAR, {"component": "0", "range": "0:500"}, "u"),
        (SCALAR, {"range": "-1.5e3:2%"}, "u"),
        (VECTOR, {"component": "z", "range": "2%:98%", "colormap": "diverging"}, "u, z"),
        (VECTOR, {"component": "magnitude", "range": "90%:7"}, "u, magnitude"),
        (TENSOR, {"component": "8"}, "u, column 8"),
        (COLOR, {}, "u"),
        (COLOR, {"component": "1", "range": "0:255"}, "u, y"),
    ],
)
def test_look_is_accepted_when_the_track_has_the_component(track, options, title):
    assert TrackColors(TrackLook("u", **options), track).title == title


@pytest.mark.parametrize(
    ("track", "options", "message"),
    [
        (SCALAR, {"component": "y"}, "got 'y'"),
        (VECTOR, {"component": "3"}, "component is 0 to 2, x, y, z, magnitude; got '3'"),
        (TENSOR, {}, "9 numbers per vertex: component is 0 to 8; select one"),
        (TENSOR, {"component": "magnitude"}, "got 'magnitude'"),
        (COLOR, {"range": "0:1"}, "shown directly; omit range"),
        (COLOR, {"colormap": "diverging"}, "omit colormap"),
        (SCALAR, {"colormap": "jet"}, "colormap is sequential or diverging; got 'jet'"),
        (SCALAR, {"range": "1"}, "a range is LOW:HIGH"),
        (SCALAR, {"range": "5:1"}, "low first"),
        (SCALAR, {"range": "2%:101%"}, "0% to 100%"),
        (SCALAR, {"range": "nan:1"}, "got 'nan:1'"),
        (SCALAR, {"range": "0:1e999"}, "got '0:1e999'"),
    ],
)
def test_error_lists_what_is_allowed_when_a_look_is_invalid(track, options, message):
    with pytest.raises(InvalidInputError, match=message):
        TrackColors(TrackLook("u", **options), track)
