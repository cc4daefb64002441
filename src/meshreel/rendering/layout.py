"""Layout of a sheet: a grid of views with titles, labels, color bars and a caption."""

from dataclasses import dataclass

import numpy as np

from meshreel.errors import InvalidInputError, Keyword
from meshreel.rendering.lettering import Font, font_of_size, line_height_px

MIN_VIEW_PX = 32
"""Minimum width and height of a view."""

ASPECTS = (0.5, 2.5)
"""Smallest and largest aspect ratio, width over height, of views that fit the mesh."""

Size = tuple[int, int]


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
