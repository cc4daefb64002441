from itertools import combinations, pairwise

import numpy as np
import pytest
from PIL import Image, ImageDraw

from meshreel.errors import InvalidInputError
from meshreel.rendering.lettering import INK, draw_lines, font_of_size, spell_out, wrap_text
from meshreel.rendering.sheets import (
    ASPECTS,
    LIGHT_INK,
    MIN_VIEW_PX,
    Annotations,
    Bar,
    Parts,
    Sheet,
    grid_shape,
    ink_on,
    plan_layout,
    plan_sheet,
    sheet_font_px,
)


def boxes(layout):
    width, height = layout.view_size
    return [(x, y, x + width, y + height) for x in layout.columns for y in layout.rows]


@pytest.mark.parametrize("aspect", [None, 0.1, 1.0, 1.7, 9.0])
@pytest.mark.parametrize(
    "parts",
    [
        Parts(1, 1),
        Parts(2, 4, n_label_lines=1),
        Parts(3, 3, n_title_lines=2, n_label_lines=1, bars=((1, 40), (2, 60)), n_caption_lines=2),
    ],
)
def test_views_are_disjoint_and_inside_the_sheet(parts, aspect):
    layout = plan_layout((900, 700), parts, 14, aspect)
    for left, top, right, bottom in boxes(layout):
        assert min(left, top) >= 0
        assert right <= layout.size[0] - sum(width for column, width in parts.bars if column == 2)
        assert bottom + parts.n_label_lines * layout.line <= layout.size[1]
    for a, b in combinations(boxes(layout), 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
    assert layout.caption_top + parts.n_caption_lines * layout.line <= layout.size[1]


def test_parts_of_a_sheet_are_ordered_without_overlap():
    parts = Parts(2, 2, n_title_lines=2, n_label_lines=1, bars=((0, 30), (1, 50)),
                  n_caption_lines=3)  # fmt: skip
    layout = plan_layout((900, 701), parts, 14)
    (width, height), gap, line = layout.view_size, layout.gap, layout.line
    assert gap == round(0.7 * line) > 0
    x = [layout.columns[0], layout.bars[0], layout.columns[1], layout.bars[1], 900]
    steps = [gap, width + gap, 30 + gap, width + gap, 50 + gap]
    assert x[0] == steps[0]
    assert [b - a for a, b in pairwise(x)] == pytest.approx(steps[1:], abs=1)
    assert layout.rows[0] == gap + 2 * line
    assert layout.rows[1] - layout.rows[0] == height + gap + line
    assert layout.caption_top - layout.rows[1] == height + gap + line - gap // 2
    assert layout.caption_top + 3 * line + gap // 2 == pytest.approx(701, abs=2)
    assert layout.body_height == 2 * height + gap + line


@pytest.mark.parametrize(
    ("size", "font_px"),
    [((100, 100), 12), ((1040, 1040), 20), ((520, 2080), 20), ((9000, 9000), 28)],
)
def test_font_size_grows_with_the_sheet_within_limits(size, font_px):
    assert sheet_font_px(size) == font_px


def test_sheet_has_the_requested_size_without_an_aspect():
    assert plan_layout((901, 333), Parts(2, 3, n_label_lines=1), 14).size == (901, 333)


def test_single_view_fills_the_sheet():
    layout = plan_layout((320, 200), Parts(1, 1), 14)
    assert layout.view_size == layout.size == (320, 200)
    assert (layout.columns, layout.rows) == ((0,), (0,))


@pytest.mark.parametrize("aspect", [0.7, 1.0, 2.0])
def test_views_have_the_aspect_of_their_content(aspect):
    layout = plan_layout((900, 700), Parts(2, 3, n_label_lines=1), 14, aspect)
    width, height = layout.view_size
    assert width / height == pytest.approx(aspect, rel=0.02)
    assert layout.size[0] <= 901
    assert layout.size[1] <= 701
    assert layout.size[0] % 2 == layout.size[1] % 2 == 0


def test_aspect_of_views_is_limited():
    width, height = plan_layout((900, 700), Parts(1, 1), 14, 100.0).view_size
    assert width / height == pytest.approx(ASPECTS[1], rel=0.02)


def test_error_for_a_small_sheet_states_the_view_size():
    with pytest.raises(InvalidInputError, match=r"60 x 60 pixels leave .* larger size"):
        plan_layout((60, 60), Parts(2, 4, n_label_lines=1), 14)
    assert plan_layout((32, 32), Parts(1, 1), 14).view_size == (32, 32)
    with pytest.raises(InvalidInputError, match="31 x 40"):
        plan_layout((31, 40), Parts(1, 1), 14)


@pytest.mark.parametrize(
    ("n_views", "aspect", "shape"),
    [
        (1, 1.0, (1, 1)),
        (8, 1.0, (2, 4)),
        (8, 0.25, (1, 8)),
        (2, 4.0, (2, 1)),
        (3, 0.5, (1, 3)),
        (5, 1.0, (2, 3)),
        (9, 1.0, (3, 3)),
    ],
)
def test_grid_shape_maximizes_the_views(n_views, aspect, shape):
    assert grid_shape(n_views, (1600, 1000), aspect) == shape


FONT = font_of_size(16)


@pytest.mark.parametrize(
    ("text", "spelled"),
    [
        ("10 \N{MICRO SIGN}m \N{MULTIPLICATION SIGN} 3°", "10 um x 3°"),
        ("±5 \N{EN DASH} 6 %", "±5 - 6 %"),
        ("é≤ü", "e<=u"),
        ("\u821e.ply", "?.ply"),
        ("plain", "plain"),
    ],
)
def test_spell_out_replaces_characters_that_the_font_lacks(text, spelled):
    assert spell_out(text) == spelled


def test_wrap_text_keeps_every_word_and_the_width():
    text = "one two three four five six seven eight nine ten"
    lines = wrap_text(text, FONT, 90)
    assert " ".join(lines) == text
    assert max(FONT.getlength(line) for line in lines) <= 90


def test_wrap_text_puts_too_wide_words_on_separate_lines():
    assert wrap_text("a incomprehensibilities b", FONT, 30) == ["a", "incomprehensibilities", "b"]
    assert wrap_text("", FONT, 90) == []


def test_draw_lines_rejects_an_unknown_alignment():
    canvas = ImageDraw.Draw(Image.new("RGB", (9, 9)))
    with pytest.raises(InvalidInputError, match="align"):
        draw_lines(canvas, (0, 0), ["a"], FONT, align="justify")


WHITE, NIGHT = (255, 255, 255), (20, 22, 30)
LONG = "a title of many words that has to be broken into several lines to fit above its view"


def blank_views(layout, n_views, color):
    width, height = layout.view_size
    return [np.full((height, width, 3), color, np.uint8) for _ in range(n_views)]


@pytest.mark.parametrize("background", [WHITE, NIGHT])
def test_text_does_not_overlap_the_views(background):
    annotations = Annotations(
        ("first", LONG), "a caption " * 30, "frame 17, 0.68 s", (Bar(0, 0.5, "%"),)
    )
    layout = plan_sheet(annotations, 6, 1.3, None, (700, 600))
    sheet = Sheet(layout, annotations, background)
    labels = ["frame 17, 0.68 s"] * 6
    views = blank_views(layout, 6, (200, 30, 30))
    filled, empty = (np.asarray(sheet.compose(images, labels)) for images in (views, ()))
    for x in layout.columns:
        for y in layout.rows:
            width, height = layout.view_size
            assert (filled[y : y + height, x : x + width] == (200, 30, 30)).all()
            assert (empty[y : y + height, x : x + width] == background).all()
    has_text = (filled != background).any(axis=2)
    has_text[layout.rows[0] : layout.caption_top] = False
    assert has_text.any()
    assert not has_text[[0, -1]].any()


def test_labels_of_narrow_views_are_wrapped():
    layout = plan_sheet(Annotations(widest_label="frame 123, 10.52 s"), 8, 0.3, (640, 320), (9, 9))
    assert layout.view_size[0] < 110
    assert layout.caption_top - layout.view_size[1] > 2 * layout.line


def test_plan_sheet_terminates_when_titles_are_long_and_the_sheet_is_small():
    layout = plan_sheet(Annotations((LONG, LONG, LONG), LONG), 3, 1.0, None, (420, 420))
    assert min(layout.view_size) >= MIN_VIEW_PX


@pytest.mark.parametrize(("background", "ink"), [(WHITE, INK), (NIGHT, LIGHT_INK)])
def test_ink_is_dark_on_light_and_light_on_dark_backgrounds(background, ink):
    assert ink_on(background) == ink


def test_labels_are_centered_below_their_views():
    annotations = Annotations(widest_label="00000")
    layout = plan_sheet(annotations, 3, 1.0, None, (700, 300))
    picture = np.asarray(
        Sheet(layout, annotations, WHITE).compose(blank_views(layout, 3, WHITE), ["00000"] * 3)
    )
    (width, height), top = layout.view_size, layout.rows[0]
    for left in layout.columns:
        below = (picture[top + height :, left : left + width] != 255).any(axis=2)
        columns = np.flatnonzero(below.any(axis=0))
        assert columns.mean() == pytest.approx(width / 2, abs=2)
