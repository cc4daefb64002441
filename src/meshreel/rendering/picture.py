"""Contact sheets of pictures, and PNG output."""

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage
from PIL import ImageDraw

from meshreel.errors import InvalidInputError
from meshreel.rendering.lettering import (
    FAINT_INK,
    Font,
    draw_lines,
    font_of_size,
    line_height_px,
    wrap_text,
)
from meshreel.runtime.outputs.atomic import replace_when_done

Panel = npt.NDArray[np.uint8] | PillowImage.Image

_SHEET = (255, 255, 255)


def contact_sheet(
    rows: Sequence[Sequence[Panel]],
    *,
    column_titles: Sequence[str] = (),
    row_titles: Sequence[str] = (),
    caption: str = "",
) -> PillowImage.Image:
    """A grid of panels with titles above and to the left and a caption below.

    Parameters
    ----------
    rows : sequence of sequences of uint8 arrays of shape (H, W, 3) or Pillow images
        At least one panel in each row; lengths of rows and sizes of panels may differ.
    column_titles, row_titles : sequence of str
        One for each column and row, or none at all.
    caption : str
        Wrapped to the width of the sheet.

    Raises
    ------
    InvalidInputError
        If a row is empty, a panel is not a picture, or the number of titles differs.
    """
    images = [[_as_image(panel) for panel in row] for row in rows]
    n_columns = max((len(row) for row in images), default=0)
    if not all(images) or n_columns == 0:
        raise InvalidInputError("a sheet needs at least one panel in each row; got an empty row")
    for name, titles, needed in (
        ("column", column_titles, n_columns),
        ("row", row_titles, len(images)),
    ):
        if len(titles) not in (0, needed):
            raise InvalidInputError(f"{needed} {name}s need {needed} titles or none; got {titles}")
    return _compose(images, list(column_titles), list(row_titles), caption)


def save_png(
    image: Panel, path: Path, *, overwrite: bool = False, dpi: float | None = None
) -> None:
    """Write a picture as a PNG file, atomically.

    Parameters
    ----------
    image : Pillow image, or uint8 array of shape (H, W, 3)
    overwrite : bool
        Whether an existing file may be replaced.
    dpi : float, optional
        Resolution, for the size of printed text. Default: not stored.

    Raises
    ------
    InvalidInputError
        If the image has the wrong type or shape, or the path cannot or must not be written.
    """
    picture = _as_image(image)
    with replace_when_done(Path(path), overwrite=overwrite) as temporary:
        resolution = {} if dpi is None else {"dpi": (dpi, dpi)}
        picture.save(temporary, format="PNG", optimize=True, **resolution)


def _as_image(panel: Panel) -> PillowImage.Image:
    if isinstance(panel, PillowImage.Image):
        return panel.convert("RGB")
    array = np.asarray(panel)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise InvalidInputError(
            f"a picture must be a uint8 array of shape (H, W, 3); got {array.dtype} {array.shape}"
        )
    return PillowImage.fromarray(array)


def _compose(
    rows: list[list[PillowImage.Image]],
    column_titles: list[str],
    row_titles: list[str],
    caption: str,
) -> PillowImage.Image:
    widths = [max(image.width for image in column if image) for column in zip_longest(*rows)]
    heights = [max(image.height for image in row) for row in rows]
    size_px = min(max(max(heights) / 30, sum(widths) / 90, 15), 30)
    font, small = font_of_size(size_px), font_of_size(size_px * 5 / 6)
    line, gap = line_height_px(font), round(0.7 * line_height_px(font))

    column_lines = [
        wrap_text(text, font, width) for text, width in zip(column_titles, widths, strict=False)
    ]
    row_lines = [wrap_text(text, font, 9 * line) for text in row_titles]
    left = 2 * gap + (_widest(row_lines, font) + gap if row_lines else 0)
    top = 2 * gap + max((len(lines) for lines in column_lines), default=0) * line
    right, bottom = left + sum(widths) + gap * len(widths), top + sum(heights) + gap * len(heights)
    caption_lines = wrap_text(caption, small, right - 3 * gap)
    sheet_height = bottom + gap + len(caption_lines) * line_height_px(small)

    sheet = PillowImage.new("RGB", (right + gap, sheet_height), _SHEET)
    canvas = ImageDraw.Draw(sheet)
    xs = [left + sum(widths[:k]) + gap * k for k in range(len(widths))]
    ys = [top + sum(heights[:k]) + gap * k for k in range(len(heights))]
    for row, y, height in zip(rows, ys, heights, strict=True):
        for image, x, width in zip(row, xs, widths, strict=False):
            sheet.paste(image, (x + (width - image.width) // 2, y + (height - image.height) // 2))
    for lines, x, width in zip(column_lines, xs, widths, strict=False):
        above = top - len(lines) * line - gap // 3
        draw_lines(canvas, (x + width / 2, above), lines, font, align="center")
    for lines, y, height in zip(row_lines, ys, heights, strict=False):
        middle = y + (height - len(lines) * line) / 2
        draw_lines(canvas, (left - gap, middle), lines, font, align="right")
    draw_lines(canvas, (2 * gap, bottom), caption_lines, small, ink=FAINT_INK)
    return sheet


def _widest(texts: list[list[str]], font: Font) -> int:
    return round(max((font.getlength(line) for lines in texts for line in lines), default=0))
