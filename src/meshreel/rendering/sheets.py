"""Sheets of views with titles, labels, a caption and colour bars, filled again for each frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image as PillowImage
from PIL import ImageDraw

from meshreel.rendering.colormap import draw_color_bar
from meshreel.rendering.layout import Layout, Parts, Place, grid_shape, plan_layout, sheet_font_px
from meshreel.rendering.lettering import INK, Ink, draw_lines, wrap_text
from meshreel.rendering.painting import Color, Image

LIGHT_INK: Ink = (232, 234, 238)
TALLEST_BAR_PX = 560


@dataclass(frozen=True)
class Bar:
    """A colour bar.

    Parameters
    ----------
    low, high : float
        Numbers at its ends.
    column : int, optional
        Of the views that it stands to the right of. Default: the last.
    colormap : str, optional
        As `colorize` takes it.
    """

    low: float
    high: float
    unit: str = ""
    column: int = -1
    colormap: str | None = None


@dataclass(frozen=True)
class Words:
    """The words on a sheet, with the numbers of its colour bars.

    Parameters
    ----------
    titles : tuple of str
        Of the columns; one empty title for views that stand in a grid without titles.
    caption : str
        At the foot.
    widest_label : str
        Of those that will stand below the views; empty for none.
    bars : tuple of Bar
        By ascending columns.
    """

    titles: tuple[str, ...] = ("",)
    caption: str = ""
    widest_label: str = ""
    bars: tuple[Bar, ...] = ()


def plan_sheet(
    words: Words, n_views: int, aspect: float, size: Place | None, most: Place
) -> Layout:
    """The layout of a sheet with all its words broken into lines that fit.

    Parameters
    ----------
    n_views : int
        A multiple of the number of titles.
    aspect : float
        Width over height of what a view shows.
    size : tuple of 2 ints or None
        Width and height of the sheet, in pixels; None follows the shape of what is shown.
    most : tuple of 2 ints
        The largest that it becomes then, but for the words.

    Raises
    ------
    InvalidInputError
        If the sheet is too small.
    """
    n_columns = len(words.titles)
    n_rows = n_views // n_columns
    if n_columns == 1:
        n_rows, n_columns = grid_shape(n_views, size or most, aspect)
    bars = tuple(
        (bar.column % n_columns, _drawn(bar, TALLEST_BAR_PX, (0, 0, 0)).shape[1])
        for bar in words.bars
    )
    n_lines = np.zeros(3, int)  # of titles, of each label, of the caption
    font_px = sheet_font_px(size or most)
    while True:
        n_titles, n_labels, n_captions = map(int, n_lines)
        parts = Parts(n_rows, n_columns, n_titles, n_labels, bars, n_captions)
        layout = plan_layout(size or most, parts, font_px, aspect if size is None else None)
        needed = [
            max(len(_fitted(title, layout)) for title in words.titles),
            len(_fitted(words.widest_label, layout)),
            len(_caption_lines(words.caption, layout)),
        ]
        fitting_px = min(font_px, sheet_font_px(layout.size))
        if np.all(needed <= n_lines) and fitting_px > font_px - 0.5:
            return layout
        n_lines, font_px = np.maximum(needed, n_lines), fitting_px


class Sheet:
    """A picture with room for views; what stays the same in all frames is drawn once.

    Parameters
    ----------
    layout : Layout
        From `plan_sheet`.
    background : three integers
        sRGB in 0..255; words are dark or light, as it is.
    """

    def __init__(self, layout: Layout, words: Words, background: Color) -> None:
        self.layout = layout
        self._ink = ink_on(background)
        self._blank = PillowImage.new("RGB", layout.size, background)
        canvas, width = ImageDraw.Draw(self._blank), layout.view_size[0]
        for title, left in zip(words.titles, layout.columns, strict=False):
            lines = _fitted(title, layout)
            top = layout.rows[0] - len(lines) * layout.line - layout.gap // 4
            self._centre(canvas, (left + width / 2, top), lines)
        caption = _caption_lines(words.caption, layout)
        draw_lines(canvas, (layout.gap, layout.foot), caption, layout.font, ink=self._ink)
        height = max(min(layout.body_height, TALLEST_BAR_PX), 80)
        for bar, left in zip(words.bars, layout.bars, strict=True):
            drawn = PillowImage.fromarray(_drawn(bar, height, background))
            self._blank.paste(drawn, (left, layout.rows[0]))

    def filled(self, views: Sequence[Image], labels: Sequence[str] = ()) -> PillowImage.Image:
        """The sheet with views, row by row, and a label below each.

        Parameters
        ----------
        views : sequence of uint8 arrays, of the size that the layout has for them
        labels : sequence of str
            One for each view, or none at all.
        """
        picture = self._blank.copy()
        canvas, (width, height) = ImageDraw.Draw(picture), self.layout.view_size
        n_columns = len(self.layout.columns)
        for number, view in enumerate(views):
            left, top = (
                self.layout.columns[number % n_columns],
                self.layout.rows[number // n_columns],
            )
            picture.paste(PillowImage.fromarray(view), (left, top))
            if labels:
                lines = _fitted(labels[number], self.layout)
                self._centre(canvas, (left + width / 2, top + height), lines)
        return picture

    def _centre(
        self, canvas: ImageDraw.ImageDraw, place: tuple[float, float], lines: list[str]
    ) -> None:
        draw_lines(canvas, place, lines, self.layout.font, ink=self._ink, align="center")


def ink_on(background: Color) -> Ink:
    """The colour of words that are easy to read there."""
    red, green, blue = background
    return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 128 else LIGHT_INK


def _fitted(words: str, layout: Layout) -> list[str]:
    return wrap_text(words, layout.font, layout.view_size[0])


def _caption_lines(caption: str, layout: Layout) -> list[str]:
    return wrap_text(caption, layout.font, layout.size[0] - 2 * layout.gap)


def _drawn(bar: Bar, height: int, background: Color) -> Image:
    return draw_color_bar(
        bar.low, bar.high,
        unit=bar.unit, colormap=bar.colormap, height=height, background=background,
        ink=ink_on(background),
    )  # fmt: skip
