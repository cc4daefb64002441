"""Color bars of heat maps."""

import numpy as np
from PIL import Image as PillowImage
from PIL import ImageDraw

from meshreel.errors import InvalidInputError
from meshreel.rendering.colormap import Image, check_range, colorize, short_number
from meshreel.rendering.lettering import (
    INK,
    Ink,
    draw_lines,
    font_of_size,
    line_height_px,
    spell_out,
)


def draw_color_bar(
    low: float,
    high: float,
    *,
    unit: str = "",
    colormap: str | None = None,
    height: int = 800,
    background: Ink = (255, 255, 255),
    ink: Ink = INK,
) -> Image:
    """A color bar for a heat map, labeled at both ends and at round numbers between them.

    Parameters
    ----------
    low, high : float
        As for `colorize`.
    unit : str
        Printed after the numbers at the ends.
    colormap : str, optional
        As for `colorize`.
    height : int
        In pixels, at least 80; the width follows from the labels.
    background, ink : three integers
        Colors of the background and the text, sRGB in 0..255.

    Returns
    -------
    uint8 array of shape (height, width, 3)

    Raises
    ------
    InvalidInputError
        If `low` exceeds `high`, the height is too small, or the map is unknown.
    """
    check_range(low, high)
    if height < 80:
        raise InvalidInputError(f"a color bar needs a height of at least 80 pixels; got {height}")
    font = font_of_size(min(max(height / 36, 13), 26))
    line = line_height_px(font)
    ticks = _ticks_with_ends(low, high, 6 if height >= 240 else 3)
    symbol = spell_out({"degrees": "°"}.get(unit, unit))
    labels = [short_number(tick, high - low) for tick in ticks]
    for end in {0, len(labels) - 1}:
        labels[end] = f"{labels[end]} {symbol}".strip()
    bar_width, pad = line, line // 2
    widest = max(font.getlength(label) for label in labels)
    width = round(bar_width + 4 * pad + widest)
    top, bottom = line, height - line
    picture = PillowImage.new("RGB", (width, height), background)
    numbers = np.linspace(high, low, bottom - top) if high > low else np.full(bottom - top, low)
    column = colorize(numbers, low, high, colormap)[:, None]
    picture.paste(PillowImage.fromarray(np.repeat(column, bar_width, axis=1)), (pad, top))
    canvas = ImageDraw.Draw(picture)
    for tick, label in zip(ticks, labels, strict=True):
        share = (tick - low) / (high - low) if high > low else 0.0
        y = round(bottom - 1 - share * (bottom - 1 - top))
        canvas.line([(pad + bar_width, y), (pad + bar_width + pad // 2, y)], fill=ink)
        draw_lines(canvas, (2 * pad + bar_width, y - 0.4 * line), [label], font, ink=ink)
    return np.asarray(picture)


def _ticks_with_ends(low: float, high: float, max_ticks: int) -> list[float]:
    """Both ends, and multiples of 1, 2 or 5 times a power of ten that are not too close to them."""
    if high == low:
        return [low]
    min_step = (high - low) / (max_ticks - 1)
    power = 10.0 ** np.floor(np.log10(min_step))
    factors = (1, 2, 5, 10)
    step = power * next(factor for factor in factors if factor * power >= min_step * (1 - 1e-9))
    gap = 0.5 * (high - low) / max_ticks
    ticks = np.arange(np.ceil(low / step), high / step) * step + 0.0
    return [low, *ticks[(low + gap < ticks) & (ticks < high - gap)].tolist(), high]
