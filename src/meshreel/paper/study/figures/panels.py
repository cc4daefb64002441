"""Figures for print: sheets of equal panels without resampling."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshreel.rendering.plots import blank_figure
from meshreel.runtime.outputs.atomic import replace_when_done

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 240
PAGE_PX = 1728, 2160
"""Largest width and height of a sheet: 7.2 x 9 inches at `DPI`, which fits a page."""

MAX_PANEL_PX = 400
"""Largest side of a square panel; other panels have at most this area."""

FONT_SIZE = 8.0
TITLE_PX, ROW_LABEL_PX, LINE_PX = 215, 240, 34
"""Widths of a title of 14 letters and of a label of 15 at `FONT_SIZE`, and line height."""

GAP_PX, BAND_GAP_PX, LABEL_PX = 14, 40, 50


@dataclass(frozen=True)
class Box:
    """A rectangle on a sheet, in pixels from its upper left corner."""

    left: float
    top: float
    width: float
    height: float


def blank_sheet(width_px: int, height_px: int) -> "Figure":
    """An empty figure of this size in pixels."""
    figure = blank_figure(width_px / DPI, height_px / DPI)
    figure.set_layout_engine("none")  # panels are positioned explicitly
    return figure


def save_for_print(figure: "Figure", path: Path) -> None:
    """Write a figure as a PNG file with `DPI` pixels per inch, atomically."""
    with replace_when_done(path, overwrite=True) as temporary:
        figure.savefig(temporary, format="png", dpi=DPI)


def axes_in(figure: "Figure", box: Box) -> "Axes":
    """Axes that fill a box of a figure from `blank_sheet`."""
    width, height = figure.get_size_inches() * DPI
    bottom = height - box.top - box.height
    return figure.add_axes(
        (box.left / width, bottom / height, box.width / width, box.height / height)
    )


def write_in(
    figure: "Figure", text: str, x: float, y: float, *, size: float = FONT_SIZE, rotation: float = 0
) -> None:
    """Write text centered at a point, in pixels from the upper left corner of a figure."""
    width, height = figure.get_size_inches() * DPI
    figure.text(
        x / width, 1 - y / height, text, ha="center", va="center", fontsize=size, rotation=rotation
    )


@dataclass(frozen=True)
class Layout:
    """Columns of panels, wrapped into several bands if a page is too narrow.

    Attributes
    ----------
    n_columns : int
        Total over all bands.
    width : int
        Panel width in pixels, a multiple of 3.
    heights : tuple of int
        Panel height of each row in pixels, multiples of 3.
    has_labels : bool
        Whether rows are labeled, in the left margin.
    """

    n_columns: int
    columns_per_band: int
    width: int
    heights: tuple[int, ...]
    n_title_lines: int
    has_labels: bool = True

    @property
    def label_px(self) -> int:
        """Width of the margin with the labels of rows."""
        return LABEL_PX if self.has_labels else GAP_PX

    @property
    def n_bands(self) -> int:
        """Number of bands."""
        return -(-self.n_columns // self.columns_per_band)

    @property
    def band_height(self) -> int:
        """Height of the titles and panels of a band, in pixels."""
        rows = sum(self.heights) + GAP_PX * (len(self.heights) - 1)
        return LINE_PX * self.n_title_lines + GAP_PX + rows

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the sheet, in pixels."""
        width = self.label_px + self.columns_per_band * (self.width + GAP_PX)
        height = self.n_bands * (self.band_height + BAND_GAP_PX) - BAND_GAP_PX
        return width, height + 2 * GAP_PX

    def cell(self, column: int, row: int) -> Box:
        """The box of a panel."""
        band, position = divmod(column, self.columns_per_band)
        top = GAP_PX + band * (self.band_height + BAND_GAP_PX)
        top += LINE_PX * self.n_title_lines + GAP_PX
        top += sum(self.heights[:row]) + GAP_PX * row
        left = self.label_px + position * (self.width + GAP_PX)
        return Box(left, top, self.width, self.heights[row])


def fit_layout(
    n_columns: int, aspects: Sequence[float], n_title_lines: int, *, has_labels: bool = True
) -> Layout:
    """The layout with the largest panels that fit on a page.

    Parameters
    ----------
    n_columns : int
        At least 1.
    aspects : sequence of float
        Ratio of width to height of the panels of each row.
    """
    max_width = MAX_PANEL_PX * aspects[0] ** 0.5

    def layout_of(columns_per_band: int, width: float) -> Layout:
        width_px = 3 * max(int(width / 3), 1)
        heights = tuple(3 * max(round(width_px / aspect / 3), 1) for aspect in aspects)
        return Layout(n_columns, columns_per_band, width_px, heights, n_title_lines, has_labels)

    def largest_layout(columns_per_band: int) -> Layout:
        empty = layout_of(columns_per_band, 0)
        width = (PAGE_PX[0] - empty.label_px) / columns_per_band - GAP_PX
        free = PAGE_PX[1] - empty.size[1]
        inverses = sum(1 / aspect for aspect in aspects)
        width = min(width, max_width, free / (empty.n_bands * inverses))
        return layout_of(columns_per_band, width)

    layouts = [largest_layout(columns_per_band) for columns_per_band in range(1, n_columns + 1)]
    # Ties go to the layout with the fewest empty cells, then to the one with the fewest bands.
    return max(
        layouts,
        key=lambda layout: (
            layout.width,
            -(-n_columns % layout.columns_per_band),
            layout.columns_per_band,
        ),
    )


def draw_sheet(layout: Layout, titles: Sequence[str], row_labels: Sequence[str] = ()) -> "Figure":
    """An empty sheet with titles of all columns and labels of the rows of each band."""
    figure = blank_sheet(*layout.size)
    size = FONT_SIZE * min(1.0, layout.width / TITLE_PX)
    for column, title in enumerate(titles):
        cell = layout.cell(column, 0)
        middle = cell.top - GAP_PX - LINE_PX * layout.n_title_lines / 2
        padding = layout.n_title_lines - 1 - title.count("\n")  # to align first lines
        write_in(figure, title + padding * "\n", cell.left + cell.width / 2, middle, size=size)
    for band in range(layout.n_bands):
        for row, label in enumerate(row_labels):
            cell = layout.cell(band * layout.columns_per_band, row)
            size = FONT_SIZE * min(1.0, cell.height / ROW_LABEL_PX)
            middle = cell.top + cell.height / 2
            write_in(figure, label, LABEL_PX / 2, middle, size=size, rotation=90)
    return figure


def show_image(figure: "Figure", box: Box, image: npt.NDArray[np.uint8]) -> "Axes":
    """Show an image of the size of the box, pixel by pixel."""
    axes = axes_in(figure, box)
    axes.imshow(image, interpolation="nearest", aspect="auto")
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    return axes
