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
NOT_A_NUMBER = (150, 150, 150)


def colorize(values: npt.ArrayLike, low: float, high: float) -> Image:
    """Colours of numbers: violet at `low` and below, over green, to yellow at `high` and above.

    Parameters
    ----------
    values : array of shape (N,)
        NaN becomes grey.
    low, high : float
        Finite; where they are equal, all numbers up to them are violet.

    Returns
    -------
    uint8 array of shape (N, 3), sRGB

    Raises
    ------
    InvalidInputError
        If the values are not a line, or `low` is not below `high`.
    """
    numbers = np.asarray(values, np.float64)
    if numbers.ndim != 1:
        raise InvalidInputError(f"values must have shape (N,); got {numbers.shape}")
    _check_range(low, high)
    width = high - low if high > low else 1.0
    known = ~np.isnan(numbers)
    position = (np.clip(np.where(known, numbers, low), low, low + width) - low) / width
    ticks = np.linspace(0, 1, len(HEAT))
    channels = [np.interp(position, ticks, HEAT[:, channel]) for channel in range(3)]
    return np.where(known[:, None], np.rint(np.stack(channels, axis=1)), NOT_A_NUMBER).astype(
        np.uint8
    )


def draw_color_bar(
    low: float,
    high: float,
    *,
    unit: str = "",
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
        If `low` is not below `high`, or the height is too small.
    """
    _check_range(low, high)
    if height < 80:
        raise InvalidInputError(f"a colour bar needs a height of at least 80 pixels; got {height}")
    font = font_of_size(min(max(height / 36, 13), 26))
    line = line_height_px(font)
    ticks = _ticks_with_ends(low, high, 6 if height >= 240 else 3)
    short = spell_out({"degrees": "°"}.get(unit, unit))
    ends = (ticks[0], ticks[-1])
    labels = [f"{tick:.4g} {short}".strip() if tick in ends else f"{tick:.4g}" for tick in ticks]
    bar_width, pad = line, line // 2
    widest = max(font.getlength(label) for label in labels)
    width = round(bar_width + 4 * pad + widest)
    top, bottom = line, height - line
    picture = PillowImage.new("RGB", (width, height), background)
    column = colorize(np.linspace(1, 0, bottom - top), 0, 1)[:, None]
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
