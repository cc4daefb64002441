"""Where the parts of a sheet stand: views in a grid, words around them, colour bars beside."""

from dataclasses import dataclass

import numpy as np

from meshreel.errors import InvalidInputError
from meshreel.rendering.lettering import Font, font_of_size, line_height_px

MIN_VIEW_PX = 32
"""Views smaller than this, on either side, show nothing."""

ASPECTS = (0.5, 2.5)
"""Views follow the shape of the mesh between these, width over height."""

Place = tuple[int, int]


@dataclass(frozen=True)
class Parts:
    """The parts of a sheet.

    Parameters
    ----------
    n_rows, n_columns : int
        Of views.
    n_title_lines : int
        Above the columns; 0 for no titles.
    n_label_lines : int
        Under each view.
    bars : tuple of (column, width in pixels)
        Colour bars, each to the right of a column of views, by ascending columns.
    n_caption_lines : int
        At the foot.
    """

    n_rows: int
    n_columns: int
    n_title_lines: int = 0
    n_label_lines: int = 0
    bars: tuple[tuple[int, int], ...] = ()
    n_caption_lines: int = 0

    @property
    def is_bare(self) -> bool:
        """Whether it is one view and nothing else, which fills the sheet."""
        words = self.n_title_lines + self.n_label_lines + self.n_caption_lines
        return self.n_rows == self.n_columns == 1 and not (words or self.bars)


@dataclass(frozen=True)
class Layout:
    """A sheet with places for all its parts, in pixels.

    Attributes
    ----------
    size, view_size : tuple of 2 ints
        Width and height, of the sheet and of each view.
    columns, rows : tuple of int
        Left of each column and top of each row of views.
    bars : tuple of int
        Left of each colour bar.
    foot : int
        Where the caption begins.
    font : Font
        Of titles and labels.
    line, gap : int
        Height of a line of text, and the distance between parts.
    """

    size: Place
    view_size: Place
    columns: tuple[int, ...]
    rows: tuple[int, ...]
    bars: tuple[int, ...]
    foot: int
    font: Font
    line: int
    gap: int

    @property
    def body_height(self) -> int:
        """From the top of the first row of views to the foot of the last."""
        return self.rows[-1] + self.view_size[1] - self.rows[0]


def sheet_font_px(size: Place) -> float:
    """How high the letters are on a sheet of about this width and height."""
    return float(np.clip(np.sqrt(size[0] * size[1]) / 52, 12, 28))


def plan_layout(size: Place, parts: Parts, font_px: float, aspect: float | None = None) -> Layout:
    """Places of all parts on a sheet.

    Parameters
    ----------
    size : tuple of 2 ints
        Width and height of the sheet, in pixels.
    font_px : float
        From `sheet_font_px`.
    aspect : float, optional
        Width over height of what the views show: they and the sheet become smaller to follow it.
        Default: views fill the sheet.

    Raises
    ------
    InvalidInputError
        If the sheet is too small for its parts.
    """
    font = font_of_size(font_px)
    line = line_height_px(font)
    gap = 0 if parts.is_bare else round(0.7 * line)
    around = _around(parts, line, gap)
    width = (size[0] - around[0]) // parts.n_columns
    height = (size[1] - around[1]) // parts.n_rows
    if min(width, height) < MIN_VIEW_PX:
        raise InvalidInputError(
            f"{size[0]} x {size[1]} pixels leave {max(width, 0)} x {max(height, 0)} for each of "
            f"{parts.n_rows} x {parts.n_columns} views; give a larger --size or fewer --frames"
        )
    if aspect is not None:
        followed = float(np.clip(aspect, *ASPECTS))
        width, height = min(width, round(height * followed)), min(height, round(width / followed))
        # Even numbers, which films must have.
        whole = around[0] + parts.n_columns * width, around[1] + parts.n_rows * height
        size = whole[0] + whole[0] % 2, whole[1] + whole[1] % 2
    top = gap + parts.n_title_lines * line
    pitch = height + gap + parts.n_label_lines * line
    columns = tuple(
        gap + number * (width + gap) + sum(bar + gap for place, bar in parts.bars if place < number)
        for number in range(parts.n_columns)
    )
    return Layout(
        size=size,
        view_size=(width, height),
        columns=columns,
        rows=tuple(top + number * pitch for number in range(parts.n_rows)),
        bars=tuple(columns[column] + width + gap for column, _ in parts.bars),
        foot=top + parts.n_rows * pitch - gap // 2,
        font=font, line=line, gap=gap,
    )  # fmt: skip


def _around(parts: Parts, line: int, gap: int) -> Place:
    """Width and height of all that is not views."""
    bar = sum(bar_width + gap for _, bar_width in parts.bars)
    n_lines = parts.n_title_lines + parts.n_rows * parts.n_label_lines + parts.n_caption_lines
    return gap * (parts.n_columns + 1) + bar, gap * (parts.n_rows + 1) + n_lines * line


def grid_shape(n_views: int, size: Place, aspect: float) -> Place:
    """Rows and columns in which views of some shape are largest on a sheet.

    Parameters
    ----------
    size : tuple of 2 ints
        Width and height of the sheet.
    aspect : float
        Width over height of a view.
    """

    def height_of_views(n_columns: int) -> float:
        n_rows = -(-n_views // n_columns)
        return min(size[1] / n_rows, size[0] / n_columns / aspect)

    n_columns = max(range(1, n_views + 1), key=height_of_views)
    n_rows = -(-n_views // n_columns)
    return n_rows, -(-n_views // n_rows)  # no more columns than the rows need
