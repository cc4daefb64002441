"""Color maps for numbers."""

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError, Keyword

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
        raise InvalidInputError(Keyword("colormap"), f" is {' or '.join(COLORMAPS)}; got {name!r}")


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
    check_range(low, high)
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


def round_up(value: float) -> float:
    """Round up to 1, 1.5, 2, 3, 4, 5, 6 or 8 times a power of ten; 0 becomes 1."""
    if value <= 0:
        return 1.0
    power = float(10.0 ** np.floor(np.log10(value)))
    factors = (1, 1.5, 2, 3, 4, 5, 6, 8, 10)
    return next(factor * power for factor in factors if factor * power >= value * (1 - 1e-9))


def check_range(low: float, high: float) -> None:
    """Raise InvalidInputError unless the ends of a range are finite and in order."""
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        raise InvalidInputError(f"low and high must be finite, low first; got {low} and {high}")


def short_number(value: float, span: float) -> str:
    """A number with four digits, or as many as distinguish it within a range of this width."""
    if not span > 0:
        return f"{value:.4g}"
    n_decimals = 4 - int(np.ceil(np.log10(span)))
    rounded = round(value, n_decimals) + 0.0  # no -0
    n_digits = int(np.ceil(np.log10(max(abs(rounded), span)))) + n_decimals
    return f"{rounded:.{max(n_digits, 4)}g}"
