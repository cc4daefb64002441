"""From numbers to colours: one map for all heat maps, and the bar that explains it."""

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

# Violet, blue, green, yellow: a path of even speed through OKLab (Ottosson 2020) whose lightness
# rises all the way, so that it reads in grey and with every kind of colour vision.
HEAT = np.array(
    [
        (65, 43, 120), (67, 57, 135), (66, 71, 149), (62, 87, 162), (57, 102, 170), (55, 118, 172),
        (54, 133, 173), (47, 149, 175), (46, 164, 172), (62, 177, 166), (80, 190, 160),
        (92, 204, 151), (113, 216, 137), (147, 225, 122), (183, 232, 109), (217, 237, 98),
        (250, 242, 94),
    ],
    np.uint8,
)  # fmt: skip

# Blue, light grey, red: both sides of 0 are alike in lightness, and grow darker evenly.
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
"""Maps by the names that users give them; those of the player's page are the same."""


def check_colormap(name: str) -> None:
    """Nothing if there is a map of this name.

    Raises
    ------
    InvalidInputError
        If there is none.
    """
    if name not in COLORMAPS:
        raise InvalidInputError(f"--colormap is {' or '.join(COLORMAPS)}; got {name!r}")


def colorize(values: npt.ArrayLike, low: float, high: float, colormap: str | None = None) -> Image:
    """Colours of numbers from `low` and below to `high` and above.

    The sequential map runs from violet over green to yellow. The diverging one runs from blue over
    light grey to red; where 0 is between `low` and `high` it is the light grey, and the darkest
    colour is at the end that is farther from 0.

    Parameters
    ----------
    values : array of shape (N,)
        NaN becomes grey.
    low, high : float
        Finite; where they are equal, all numbers up to them have the first colour.
    colormap : str, optional
        One of `COLORMAPS`. Default: "diverging" if 0 is between `low` and `high`, else
        "sequential".

    Returns
    -------
    uint8 array of shape (N, 3), sRGB

    Raises
    ------
    InvalidInputError
        If the values are not a line, `low` is not below `high`, or there is no such map.
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
    known = ~np.isnan(numbers)
    position = (np.clip(np.where(known, numbers, low), low, low + width) - low) / width
    ticks = np.linspace(0, 1, len(colors))
    channels = [np.interp(position, ticks, colors[:, channel]) for channel in range(3)]
    return np.where(known[:, None], np.rint(np.stack(channels, axis=1)), NOT_A_NUMBER).astype(
        np.uint8
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
    """A bar of the colours of `colorize` with numbers beside it, to stand by a heat map.

    Both ends have theirs, with the unit; those between are round.

    Parameters
    ----------
    low, high : float
        As given to `colorize`.
    unit : str
        Written behind the numbers at the ends.
    colormap : str, optional
        As given to `colorize`.
    height : int
        In pixels, at least 80; the width follows from the labels.
    background, ink : three integers
        Colours behind the bar and of the words, sRGB in 0..255.

    Returns
    -------
    uint8 array of shape (height, width, 3)

    Raises
    ------
    InvalidInputError
        If `low` is not below `high`, the height is too small, or there is no such map.
    """
    _check_range(low, high)
    if height < 80:
        raise InvalidInputError(f"a colour bar needs a height of at least 80 pixels; got {height}")
    font = font_of_size(min(max(height / 36, 13), 26))
    line = line_height_px(font)
    ticks = _ticks_with_ends(low, high, 6 if height >= 240 else 3)
    short = spell_out({"degrees": "°"}.get(unit, unit))
    labels = [short_number(tick, high - low) for tick in ticks]
    for end in {0, len(labels) - 1}:
        labels[end] = f"{labels[end]} {short}".strip()
    bar_width, pad = line, line // 2
    widest = max(font.getlength(label) for label in labels)
    width = round(bar_width + 4 * pad + widest)
    top, bottom = line, height - line
    picture = PillowImage.new("RGB", (width, height), background)
    shown = np.linspace(high, low, bottom - top) if high > low else np.full(bottom - top, low)
    column = colorize(shown, low, high, colormap)[:, None]
    picture.paste(PillowImage.fromarray(np.repeat(column, bar_width, axis=1)), (pad, top))
    canvas = ImageDraw.Draw(picture)
    for tick, label in zip(ticks, labels, strict=True):
        share = (tick - low) / (high - low) if high > low else 0.0
        y = round(bottom - 1 - share * (bottom - 1 - top))
        canvas.line([(pad + bar_width, y), (pad + bar_width + pad // 2, y)], fill=ink)
        draw_lines(canvas, (2 * pad + bar_width, y - 0.4 * line), [label], font, ink=ink)
    return np.asarray(picture)


def round_up(value: float) -> float:
    """The least of 1, 1.5, 2, 3, 4, 5, 6 and 8 times a power of ten that is not below a number.

    Colour bars end there, at a number that is written beside them; 1 for 0.
    """
    if value <= 0:
        return 1.0
    power = float(10.0 ** np.floor(np.log10(value)))
    factors = (1, 1.5, 2, 3, 4, 5, 6, 8, 10)
    return next(factor * power for factor in factors if factor * power >= value * (1 - 1e-9))


def _check_range(low: float, high: float) -> None:
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        raise InvalidInputError(f"low and high must be finite, low first; got {low} and {high}")


def _ticks_with_ends(low: float, high: float, n_most: int) -> list[float]:
    """Both ends of the range, and round numbers between that are not too near to them."""
    if high == low:
        return [low]
    apart = 0.5 * (high - low) / n_most
    inner = [tick for tick in _round_ticks(low, high, n_most) if low + apart < tick < high - apart]
    return [low, *inner, high]


def short_number(value: float, span: float) -> str:
    """A number with four digits, or as many as tell it from others in a range so wide."""
    if not span > 0:
        return f"{value:.4g}"
    n_decimals = 4 - int(np.ceil(np.log10(span)))
    rounded = round(value, n_decimals) + 0.0  # no -0
    n_digits = int(np.ceil(np.log10(max(abs(rounded), span)))) + n_decimals
    return f"{rounded:.{max(n_digits, 4)}g}"


def _round_ticks(low: float, high: float, n_most: int) -> list[float]:
    """At most `n_most` multiples of 1, 2 or 5 times a power of ten in the range, or its ends."""
    if high == low:
        return [low]
    least = (high - low) / (n_most - 1)
    power = 10.0 ** np.floor(np.log10(least))
    apart = power * next(factor for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-9))
    first, last = np.ceil(low / apart - 1e-9), np.floor(high / apart + 1e-9)
    ticks = [float(number * apart) + 0.0 for number in np.arange(first, last + 1)]
    return ticks if len(ticks) > 1 else [low, high]
