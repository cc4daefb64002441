import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.rendering.color_bars import draw_color_bar
from meshreel.rendering.colormap import DIVERGING, HEAT


def test_draw_color_bar_has_the_high_end_at_the_top():
    bar = draw_color_bar(0, 1, unit="mm", height=300)
    rows = [np.flatnonzero((bar == color).all(axis=2).any(axis=1)) for color in HEAT[[0, -1]]]
    assert rows[1].max() < rows[0].min()


def test_draw_color_bar_writes_the_unit():
    assert draw_color_bar(0, 1, unit="mm").shape[1] > draw_color_bar(0, 1).shape[1]


@pytest.mark.parametrize("high", [1.0, 1.5, 3.0, 6.0, 0.008])
@pytest.mark.parametrize("height", [120, 500])
def test_draw_color_bar_has_a_number_at_both_ends(high, height):
    bar = draw_color_bar(0, high, unit="%", height=height)
    colored = np.flatnonzero((np.ptp(bar.astype(int), axis=2) > 60).any(axis=1))
    letters = (bar[:, -bar.shape[1] // 2 :].max(axis=2) < 120).any(axis=1)
    for end in (colored[0], colored[-1]):
        assert letters[end - 6 : end + 7].sum() >= 5


@pytest.mark.parametrize(("low", "high"), [(0, 0), (0, 1e-9), (-3e7, 8e7), (0.7, 0.70001)])
def test_draw_color_bar_keeps_its_height_for_unusual_ranges(low, high):
    assert draw_color_bar(low, high, unit="m", height=200).shape[0] == 200


def test_draw_color_bar_rejects_a_height_that_is_too_small_for_labels():
    with pytest.raises(InvalidInputError, match="80"):
        draw_color_bar(0, 1, height=20)


def test_color_bar_uses_the_named_map():
    bar = draw_color_bar(0, 1, colormap="diverging", height=300).reshape(-1, 3)
    for color in DIVERGING[[0, -1]]:
        assert (bar == color).all(axis=1).any()
    assert not (bar == HEAT[-1]).all(axis=1).any()
