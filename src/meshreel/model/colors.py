"""Colors: sRGB (IEC 61966-2-1) in sequences, linear in some files; opacity is linear in both.

Integers are in 0..255, or 0..65535 if they are uint16. Floats may exceed 0..1: values above 1
follow the same function, and negative ones its mirror image, as in CSS Color 4.
"""

from typing import Any

import numpy as np

from meshreel.arrays import Floats, Values

RGB = slice(0, 3)
"""Components to convert."""

LINEAR_END = 0.0031306684425005523
"""Where both parts of the function meet, so that it can be inverted; the standard rounds it up."""


def white(dtype: np.dtype[Any]) -> int:
    """Return the number of the brightest color."""
    return 1 if dtype.kind == "f" else 0xFFFF if dtype == np.uint16 else 0xFF


def unit_colors(colors: Values) -> Values:
    """Return colors whose integers are divided by their maximum."""
    return colors if colors.dtype.kind == "f" else colors / white(colors.dtype)


@np.errstate(invalid="ignore")  # NaN
def to_srgb(linear: Values) -> Floats:
    """Return linear colors of shape (N, C) in sRGB."""
    colors = unit_colors(linear).astype(np.float64)
    light = np.abs(colors[:, RGB])
    curve = 1.055 * np.maximum(light, LINEAR_END) ** (1 / 2.4) - 0.055
    encoded = np.where(light <= LINEAR_END, 12.92 * light, curve)
    colors[:, RGB] = np.copysign(encoded, colors[:, RGB])
    return colors


@np.errstate(invalid="ignore")
def to_linear(srgb: Values) -> Floats:
    """Return the linear values of sRGB colors of shape (N, C), the inverse of `to_srgb`."""
    colors = unit_colors(srgb).astype(np.float64)
    value = np.abs(colors[:, RGB])
    curve = ((value + 0.055) / 1.055) ** 2.4
    decoded = np.where(value <= 12.92 * LINEAR_END, value / 12.92, curve)
    colors[:, RGB] = np.copysign(decoded, colors[:, RGB])
    return colors


def colors_of_linear(stored: Values) -> Values:
    """Return the sRGB colors of linear ones in a file, as float32, or float64 if the file has it.

    Numbers of sRGB bytes, rounded to float32 or 16 bits, become those of the bytes again. Integers
    are restored by `to_linear`, and floats up to a few units in their last place.
    """
    exact, linear = to_srgb(stored), unit_colors(stored)
    of_bytes = np.rint(255 * exact) / 255
    rounding = 4 * np.finfo(linear.dtype).eps * linear if linear is stored else 0.5 / 0xFFFF
    exact = np.where(np.abs(to_linear(of_bytes) - linear) <= rounding, of_bytes, exact)
    if stored.dtype == np.uint8:  # 16 bits suffice, and are smaller in a stream than a float
        exact = np.rint(0xFFFF * exact) / 0xFFFF
    return exact if stored.dtype == np.float64 else exact.astype(np.float32)


def linear_of_colors(colors: Values) -> Values:
    """Return colors in 0..1 as linear numbers: integers from which they can be restored, or floats.

    Returns
    -------
    uint8, uint16 or float32 array of shape (N, C)
        Integers are normalized.
    """
    linear, kept = to_linear(colors), unit_colors(colors).astype(np.float32)
    for dtype in (np.uint8, np.uint16):
        stored = np.rint(linear * np.iinfo(dtype).max).astype(dtype)
        if np.array_equal(colors_of_linear(stored), kept):
            return stored
    return linear.astype(np.float32)
