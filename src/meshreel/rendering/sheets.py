"""Sheets of views with titles, labels, a caption and color bars."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image as PillowImage
from PIL import ImageDraw

from meshreel.rendering.color_bars import draw_color_bar
from meshreel.rendering.layout import Layout, Parts, Size, grid_shape, plan_layout, sheet_font_px
from meshreel.rendering.lettering import INK, Ink, draw_lines, wrap_text
from meshreel.rendering.painting import Color, Image

LIGHT_INK: Ink = (232, 234, 238)
MAX_BAR_HEIGHT_PX = 560


@dataclass(frozen=True)
class Bar:
    """A color bar."""

    low: float
    high: float
    """Numbers at its ends."""
    unit: str = ""
    column: int = -1
    """The bar is to the right of this column of views. Default: the last."""
    colormap: str | None = None
    """As for `colorize`."""


@dataclass(frozen=True)
class Annotations:
    """Text and color bars of a sheet."""

    titles: tuple[str, ...] = ("",)
    """Titles of the columns; one empty title for a grid of views without titles."""
    caption: str = ""
    """Text at the bottom."""
    widest_label: str = ""
    """The widest label below a view; empty without labels."""
    bars: tuple[Bar, ...] = ()
    """By ascending columns."""


def plan_sheet(
    annotations: Annotations, n_views: int, aspect: float, size: Size | None, max_size: Size
) -> Layout:
    """Lay out a sheet so that all its wrapped text fits.

    Parameters
    ----------
    n_views : int
        A multiple of the number of titles.
    aspect : float
        Width over height of the content of a view.
    size : tuple of 2 ints or None
        Width and height of the sheet, in pixels; None to fit the content.
    max_size : tuple of 2 ints
        Limit if `size` is None.

    Raises
    ------
    InvalidInputError
        If the sheet is too small.
    """
    n_columns = len(annotations.titles)
    n_rows = n_views // n_columns
    if n_columns == 1:
        n_rows, n_columns = grid_shape(n_views, size or max_size, aspect)
    bars = tuple(
        (bar.column % n_columns, _draw_bar(bar, MAX_BAR_HEIGHT_PX, (0, 0, 0)).shape[1])
        for bar in annotations.bars
    )
    n_lines = np.zeros(3, int)  # of titles, of each label, of the caption
    font_px = sheet_font_px(size or max_size)
    while True:
        n_titles, n_labels, n_captions = map(int, n_lines)
        parts = Parts(n_rows, n_columns, n_titles, n_labels, bars, n_captions)
        layout = plan_layout(size or max_size, parts, font_px, aspect if size is None else None)
        n_needed = [
            max(len(_wrap_to_view(title, layout)) for title in annotations.titles),
            len(_wrap_to_view(annotations.widest_label, layout)),
            len(_wrap_caption(annotations.caption, layout)),
        ]
        fitting_px = min(font_px, sheet_font_px(layout.size))
        if np.all(n_needed <= n_lines) and fitting_px > font_px - 0.5:
            return layout
        n_lines, font_px = np.maximum(n_needed, n_lines), fitting_px


class Sheet:
    """A sheet whose text and bars are drawn once for all frames.

    Parameters
    ----------
    layout : Layout
        From `plan_sheet`.
    background : three integers
        sRGB in 0..255; text is light on dark backgrounds.
    """

    def __init__(self, layout: Layout, annotations: Annotations, background: Color) -> None:
        self.layout = layout
        self._ink = ink_on(background)
        self._blank = PillowImage.new("RGB", layout.size, background)
        canvas, width = ImageDraw.Draw(self._blank), layout.view_size[0]
        for title, left in zip(annotations.titles, layout.columns, strict=False):
            lines = _wrap_to_view(title, layout)
            top = layout.rows[0] - len(lines) * layout.line - layout.gap // 4
            self._draw_centered(canvas, (left + width / 2, top), lines)
        caption = _wrap_caption(annotations.caption, layout)
        draw_lines(canvas, (layout.gap, layout.caption_top), caption, layout.font, ink=self._ink)
        height = max(min(layout.body_height, MAX_BAR_HEIGHT_PX), 80)
        for bar, left in zip(annotations.bars, layout.bars, strict=True):
            image = PillowImage.fromarray(_draw_bar(bar, height, background))
            self._blank.paste(image, (left, layout.rows[0]))

    def compose(self, views: Sequence[Image], labels: Sequence[str] = ()) -> PillowImage.Image:
        """Return the sheet with views, row by row, and a label below each.

        Parameters
        ----------
        views : sequence of uint8 arrays of the view size of the layout
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
                lines = _wrap_to_view(labels[number], self.layout)
                self._draw_centered(canvas, (left + width / 2, top + height), lines)
        return picture

    def _draw_centered(
        self, canvas: ImageDraw.ImageDraw, position: tuple[float, float], lines: list[str]
    ) -> None:
        draw_lines(canvas, position, lines, self.layout.font, ink=self._ink, align="center")


def ink_on(background: Color) -> Ink:
    """A readable text color for a background."""
    red, green, blue = background
    return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 128 else LIGHT_INK


def _wrap_to_view(text: str, layout: Layout) -> list[str]:
    return wrap_text(text, layout.font, layout.view_size[0])


def _wrap_caption(caption: str, layout: Layout) -> list[str]:
    return wrap_text(caption, layout.font, layout.size[0] - 2 * layout.gap)


def _draw_bar(bar: Bar, height: int, background: Color) -> Image:
    return draw_color_bar(
        bar.low, bar.high,
        unit=bar.unit, colormap=bar.colormap, height=height, background=background,
        ink=ink_on(background),
    )  # fmt: skip
