"""Color maps for numbers, and color bars."""

import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage
from PIL import ImageDraw

from meshreel.errors import InvalidInputError
from meshreel.rendering.lettering import (
    INK,
    Ink,
    draw_lines,
    font_of_size,
    line_height_px,
    spell_out,
)

Image = npt.NDArray[np.uint8]

# Violet, blue, green, yellow: perceptually uniform in OKLab (Ottosson 2020), with increasing
# lightness, so that it is readable in grayscale and with every kind of color vision.
HEAT = np.array(
    [
        (65, 43, 120), (67, 57, 135), (66, 71, 149), (62, 87, 162), (57, 102, 170), (55, 118, 172),
        (54, 133, 173), (47, 149, 175), (46, 164, 172), (62, 177, 166), (80, 190, 160),
        (92, 204, 151), (113, 216, 137), (147, 225, 122), (183, 232, 109), (217, 237, 98),
        (250, 242, 94),
    ],
    np.uint8,
)  # fmt: skip

# Blue, light gray, red: symmetric in lightness, which decreases evenly away from 0.
DIVERGING = np.array(
    [
        (6, 72, 156), (43, 94, 168), (71, 115, 179), (98, 135, 190), (125, 155, 200),
        (153, 176, 210), (181, 197, 220), (209, 217, 229), (238, 238, 238), (229, 212, 210),
        (219, 187, 182), (208, 161, 155), (196, 136, 128), (184, 111, 102), (170, 86, 76),
        (156, 59, 51), (141, 27, 23),
    ],
    np.uint8,
)  # fmt: skip
NOT_A_NUMBER = (150, 150, 150)

COLORMAPS = {"sequential": HEAT, "diverging": DIVERGING}
"""Color maps by name, the same as in the player."""


def check_colormap(name: str) -> None:
    """Raise InvalidInputError unless a color map has this name."""
    if name not in COLORMAPS:
        raise InvalidInputError(f"--colormap is {' or '.join(COLORMAPS)}; got {name!r}")


def colorize(values: npt.ArrayLike, low: float, high: float, colormap: str | None = None) -> Image:
    """Colors of numbers, clipped to the range from `low` to `high`.

    The sequential map runs from violet over green to yellow. The diverging one runs from blue over
    light gray to red; if 0 is between `low` and `high` it is light gray, and the end farther from 0
    has the darkest color.

    Parameters
    ----------
    values : array of shape (N,)
        NaN becomes gray.
    low, high : float
        Finite; if they are equal, all numbers up to them have the first color.
    colormap : str, optional
        One of `COLORMAPS`. Default: "diverging" if 0 is between `low` and `high`, else
        "sequential".

    Returns
    -------
    uint8 array of shape (N, 3), sRGB

    Raises
    ------
    InvalidInputError
        If the values are not one-dimensional, `low` exceeds `high`, or the map is unknown.
    """
    numbers = np.asarray(values, np.float64)
    if numbers.ndim != 1:
        raise InvalidInputError(f"values must have shape (N,); got {numbers.shape}")
    _check_range(low, high)
    is_0_inside = low < 0 < high
    name = colormap or ("diverging" if is_0_inside else "sequential")
    check_colormap(name)
    colors = COLORMAPS[name]
    if name == "diverging" and is_0_inside:
        high = max(-low, high)
        low = -high
    width = high - low if high > low else 1.0
    is_number = ~np.isnan(numbers)
    position = (np.clip(np.where(is_number, numbers, low), low, low + width) - low) / width
    ticks = np.linspace(0, 1, len(colors))
    channels = [np.interp(position, ticks, colors[:, channel]) for channel in range(3)]
    rgb = np.rint(np.stack(channels, axis=1))
    return np.where(is_number[:, None], rgb, NOT_A_NUMBER).astype(np.uint8)


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
    _check_range(low, high)
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


def round_up(value: float) -> float:
    """Round up to 1, 1.5, 2, 3, 4, 5, 6 or 8 times a power of ten; 0 becomes 1."""
    if value <= 0:
        return 1.0
    power = float(10.0 ** np.floor(np.log10(value)))
    factors = (1, 1.5, 2, 3, 4, 5, 6, 8, 10)
    return next(factor * power for factor in factors if factor * power >= value * (1 - 1e-9))


def _check_range(low: float, high: float) -> None:
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        raise InvalidInputError(f"low and high must be finite, low first; got {low} and {high}")


def _ticks_with_ends(low: float, high: float, max_ticks: int) -> list[float]:
    """Both ends of the range, and round numbers in between that are not too close to them."""
    if high == low:
        return [low]
    gap = 0.5 * (high - low) / max_ticks
    inner = [tick for tick in _round_ticks(low, high, max_ticks) if low + gap < tick < high - gap]
    return [low, *inner, high]


def short_number(value: float, span: float) -> str:
    """A number with four digits, or as many as distinguish it within a range of this width."""
    if not span > 0:
        return f"{value:.4g}"
    n_decimals = 4 - int(np.ceil(np.log10(span)))
    rounded = round(value, n_decimals) + 0.0  # no -0
    n_digits = int(np.ceil(np.log10(max(abs(rounded), span)))) + n_decimals
    return f"{rounded:.{max(n_digits, 4)}g}"


def _round_ticks(low: float, high: float, max_ticks: int) -> list[float]:
    """At most this many multiples of 1, 2 or 5 times a power of ten in the range, or its ends."""
    min_step = (high - low) / (max_ticks - 1)
    power = 10.0 ** np.floor(np.log10(min_step))
    factors = (1, 2, 5, 10)
    step = power * next(factor for factor in factors if factor * power >= min_step * (1 - 1e-9))
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    ticks = [float(number * step) + 0.0 for number in np.arange(first, last + 1)]
    return ticks if len(ticks) > 1 else [low, high]
