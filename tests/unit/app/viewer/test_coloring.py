"""The track that the player opens with: what can be shown of it, and what cannot."""

import numpy as np
import pytest

from meshreel.app.viewer.coloring import Coloring
from meshreel.errors import InvalidInputError
from meshreel.model.tracks import Track

SCALAR = Track(np.zeros((2, 5), np.float32))
VECTOR = Track(np.zeros((2, 5, 3), np.float32), kind="vector")
TENSOR = Track(np.zeros((2, 5, 9), np.float32))
COLOR = Track(np.zeros((2, 5, 3), np.uint8), kind="color")


@pytest.mark.parametrize(
    ("track", "options"),
    [
        (SCALAR, {}),
        (SCALAR, {"component": "0", "range": "0:500"}),
        (SCALAR, {"range": "-1.5e3:2%"}),
        (VECTOR, {"component": "z", "range": "2%:98%", "colormap": "diverging"}),
        (VECTOR, {"component": "magnitude", "range": "90%:7"}),
        (TENSOR, {"component": "8"}),
        (COLOR, {}),
        (COLOR, {"component": "1", "range": "0:255"}),
    ],
)
def test_coloring_is_allowed_when_the_track_has_it(track, options):
    coloring = Coloring("u", **options)
    coloring.check(track)
    assert coloring.described() == {
        "track": "u",
        **{name: options.get(name) for name in ("component", "range", "colormap")},
    }


@pytest.mark.parametrize(
    ("track", "options", "words"),
    [
        (SCALAR, {"component": "y"}, "got 'y'"),
        (VECTOR, {"component": "3"}, "--component is 0 to 2, x, y, z, magnitude; got '3'"),
        (TENSOR, {}, "9 numbers per vertex: --component is 0 to 8; select one"),
        (TENSOR, {"component": "magnitude"}, "got 'magnitude'"),
        (COLOR, {"range": "0:1"}, "shown directly; omit --range"),
        (COLOR, {"colormap": "diverging"}, "omit --colormap"),
        (SCALAR, {"colormap": "jet"}, "--colormap is sequential or diverging; got 'jet'"),
        (SCALAR, {"range": "1"}, "a range is LOW:HIGH"),
        (SCALAR, {"range": "5:1"}, "low first"),
        (SCALAR, {"range": "2%:101%"}, "0% to 100%"),
        (SCALAR, {"range": "nan:1"}, "got 'nan:1'"),
        (SCALAR, {"range": "0:1e999"}, "got '0:1e999'"),
    ],
)
def test_coloring_says_what_is_allowed_when_the_track_has_it_not(track, options, words):
    with pytest.raises(InvalidInputError, match=words):
        Coloring("u", **options).check(track)
