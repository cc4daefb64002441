import numpy as np
import pytest

from meshreel.rendering.layout import MIN_VIEW_PX
from meshreel.rendering.lettering import INK
from meshreel.rendering.sheets import LIGHT_INK, Bar, Sheet, Words, ink_on, plan_sheet

WHITE, NIGHT = (255, 255, 255), (20, 22, 30)
LONG = "a title of many words that has to be broken into several lines to fit above its view"


def blank_views(layout, n_views, color):
    width, height = layout.view_size
    return [np.full((height, width, 3), color, np.uint8) for _ in range(n_views)]


@pytest.mark.parametrize("background", [WHITE, NIGHT])
def test_text_does_not_overlap_the_views(background):
    words = Words(("first", LONG), "a caption " * 30, "frame 17, 0.68 s", (Bar(0, 0.5, "%"),))
    layout = plan_sheet(words, 6, 1.3, None, (700, 600))
    sheet = Sheet(layout, words, background)
    labels = ["frame 17, 0.68 s"] * 6
    views = blank_views(layout, 6, (200, 30, 30))
    filled, empty = (np.asarray(sheet.compose(images, labels)) for images in (views, ()))
    for x in layout.columns:
        for y in layout.rows:
            width, height = layout.view_size
            assert (filled[y : y + height, x : x + width] == (200, 30, 30)).all()
            assert (empty[y : y + height, x : x + width] == background).all()
    has_text = (filled != background).any(axis=2)
    has_text[layout.rows[0] : layout.foot] = False
    assert has_text.any()
    assert not has_text[[0, -1]].any()


def test_labels_of_narrow_views_are_wrapped():
    layout = plan_sheet(Words(widest_label="frame 123, 10.52 s"), 8, 0.3, (640, 320), (9, 9))
    assert layout.view_size[0] < 110
    assert layout.foot - layout.view_size[1] > 2 * layout.line


def test_plan_sheet_terminates_when_titles_are_long_and_the_sheet_is_small():
    layout = plan_sheet(Words((LONG, LONG, LONG), LONG), 3, 1.0, None, (420, 420))
    assert min(layout.view_size) >= MIN_VIEW_PX


@pytest.mark.parametrize(("background", "ink"), [(WHITE, INK), (NIGHT, LIGHT_INK)])
def test_ink_is_dark_on_light_and_light_on_dark_backgrounds(background, ink):
    assert ink_on(background) == ink


def test_labels_are_centered_below_their_views():
    words = Words(widest_label="00000")
    layout = plan_sheet(words, 3, 1.0, None, (700, 300))
    picture = np.asarray(
        Sheet(layout, words, WHITE).compose(blank_views(layout, 3, WHITE), ["00000"] * 3)
    )
    (width, height), top = layout.view_size, layout.rows[0]
    for left in layout.columns:
        below = (picture[top + height :, left : left + width] != 255).any(axis=2)
        columns = np.flatnonzero(below.any(axis=0))
        assert columns.mean() == pytest.approx(width / 2, abs=2)
