"""Sheets: a grid of views with titles, labels, color bars and a caption."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image as PillowImage
from PIL import ImageDraw

from meshreel.errors import InvalidInputError, Keyword
from meshreel.rendering.color_bars import draw_color_bar
from meshreel.rendering.lettering import (
    INK,
    Font,
    Ink,
    draw_lines,
    font_of_size,
    line_height_px,
    wrap_text,
)
from meshreel.rendering.painting import Color, Image

LIGHT_INK: Ink = (232, 234, 238)
MAX_BAR_HEIGHT_PX = 560

MIN_VIEW_PX = 32
"""Minimum width and height of a view."""

ASPECTS = (0.5, 2.5)
"""Smallest and largest aspect ratio, width over height, of views that fit the mesh."""

Size = tuple[int, int]


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


@dataclass(frozen=True)
class Parts:
    """The parts of a sheet."""

    n_rows: int
    n_columns: int
    """Rows and columns of views."""
    n_title_lines: int = 0
    """Above the columns; 0 without titles."""
    n_label_lines: int = 0
    """Below each view."""
    bars: tuple[tuple[int, int], ...] = ()
    """Column and width in pixels of color bars, each to the right of a column of views, by
    ascending columns.
    """
    n_caption_lines: int = 0
    """At the bottom."""

    @property
    def is_bare(self) -> bool:
        """Whether the sheet is a single view without text and bars."""
        n_lines = self.n_title_lines + self.n_label_lines + self.n_caption_lines
        return self.n_rows == self.n_columns == 1 and not (n_lines or self.bars)


@dataclass(frozen=True)
class Layout:
    """Positions of all parts of a sheet, in pixels."""

    size: Size
    view_size: Size
    """Width and height, of the sheet and of each view."""
    columns: tuple[int, ...]
    rows: tuple[int, ...]
    """Left edge of each column and top edge of each row of views."""
    bars: tuple[int, ...]
    """Left edge of each color bar."""
    caption_top: int
    """Top of the caption."""
    font: Font
    """Font of titles and labels."""
    line: int
    gap: int
    """Height of a line of text, and the distance between parts."""

    @property
    def body_height(self) -> int:
        """Height from the top of the first row of views to the bottom of the last."""
        return self.rows[-1] + self.view_size[1] - self.rows[0]


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


def sheet_font_px(size: Size) -> float:
    """Font height for a sheet of about this size."""
    return float(np.clip(np.sqrt(size[0] * size[1]) / 52, 12, 28))


def plan_layout(size: Size, parts: Parts, font_px: float, aspect: float | None = None) -> Layout:
    """Return the positions of all parts on a sheet.

    Parameters
    ----------
    size : tuple of 2 ints
        Width and height of the sheet, in pixels.
    font_px : float
        From `sheet_font_px`.
    aspect : float, optional
        Width over height of the visible mesh; views and sheet shrink to fit it. Default: views
        fill the sheet.

    Raises
    ------
    InvalidInputError
        If the sheet is too small for its parts.
    """
    font = font_of_size(font_px)
    line = line_height_px(font)
    gap = 0 if parts.is_bare else round(0.7 * line)
    bar_width = sum(width + gap for _, width in parts.bars)
    n_lines = parts.n_title_lines + parts.n_rows * parts.n_label_lines + parts.n_caption_lines
    margins = (
        gap * (parts.n_columns + 1) + bar_width,
        gap * (parts.n_rows + 1) + n_lines * line,
    )
    width = (size[0] - margins[0]) // parts.n_columns
    height = (size[1] - margins[1]) // parts.n_rows
    if min(width, height) < MIN_VIEW_PX:
        raise InvalidInputError(
            f"{size[0]} x {size[1]} pixels leave {max(width, 0)} x {max(height, 0)} for each of "
            f"{parts.n_rows} x {parts.n_columns} views; give a larger ",
            Keyword("size"),
            " or fewer ",
            Keyword("frames"),
        )
    if aspect is not None:
        aspect = float(np.clip(aspect, *ASPECTS))
        width, height = min(width, round(height * aspect)), min(height, round(width / aspect))
        total = margins[0] + parts.n_columns * width, margins[1] + parts.n_rows * height
        size = total[0] + total[0] % 2, total[1] + total[1] % 2  # H.264 needs even sides
    top = gap + parts.n_title_lines * line
    pitch = height + gap + parts.n_label_lines * line
    columns = tuple(
        gap
        + number * (width + gap)
        + sum(bar_width + gap for column, bar_width in parts.bars if column < number)
        for number in range(parts.n_columns)
    )
    return Layout(
        size=size,
        view_size=(width, height),
        columns=columns,
        rows=tuple(top + number * pitch for number in range(parts.n_rows)),
        bars=tuple(columns[column] + width + gap for column, _ in parts.bars),
        caption_top=top + parts.n_rows * pitch - gap // 2,
        font=font, line=line, gap=gap,
    )  # fmt: skip


def grid_shape(n_views: int, size: Size, aspect: float) -> Size:
    """Rows and columns of the grid with the largest views.

    Parameters
    ----------
    size : tuple of 2 ints
        Width and height of the sheet.
    aspect : float
        Width over height of a view.
    """

    def view_height(n_columns: int) -> float:
        n_rows = -(-n_views // n_columns)
        return min(size[1] / n_rows, size[0] / n_columns / aspect)

    n_columns = max(range(1, n_views + 1), key=view_height)
    n_rows = -(-n_views // n_columns)
    return n_rows, -(-n_views // n_rows)  # no more columns than the rows need


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
