"""Filters of meshoptimizer: decode vectors, rotations, numbers and colors.

Each takes and returns bytes of shape (N, byteStride).
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Bytes


def _octahedral(elements: Bytes) -> Bytes:
    """Decode unit vectors in octahedral encoding; the fourth component is unchanged."""
    rows = elements.view(f"<i{elements.shape[1] // 4}")
    decoded, maximum = rows.copy(), np.iinfo(rows.dtype).max
    x, y = (rows[:, :2] / np.maximum(rows[:, 2:3], 1).astype(np.float64)).T
    z = 1 - np.abs(x) - np.abs(y)
    below = np.minimum(z, 0)
    x, y = x - np.copysign(below, x), y - np.copysign(below, y)
    vectors = np.stack([x, y, z], axis=1)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    decoded[:, :3] = _rounded(vectors / np.maximum(lengths, 1e-9) * maximum)
    return decoded.view(np.uint8)


def _quaternion(elements: Bytes) -> Bytes:
    """Decode unit quaternions from their three smallest components."""
    rows = elements.view("<i2")
    one = (rows[:, 3:] | 3).astype(np.float64)
    small = rows[:, :3] / np.where(one == 0, 1, one) * np.sqrt(0.5)
    largest = np.sqrt(np.maximum(0, 1 - (small**2).sum(axis=1, keepdims=True)))
    places = ((rows[:, 3:] & 3) + np.array([1, 2, 3, 0])) % 4
    quaternions = np.empty_like(rows)
    values = np.clip(_rounded(np.concatenate([small, largest], axis=1) * 32767), -32767, 32767)
    np.put_along_axis(quaternions, places.astype(np.int64), values.astype(np.int16), axis=1)
    return quaternions.view(np.uint8)


def _exponential(elements: Bytes) -> Bytes:
    """Decode float32 from 8-bit exponents and 24-bit mantissas."""
    rows = elements.view("<i4")
    with np.errstate(over="ignore"):  # non-finite values are reported where they are used
        numbers = np.ldexp((rows << 8 >> 8).astype(np.float32), rows >> 24)
    floats: Bytes = numbers.astype("<f4").view(np.uint8)
    return floats


def _color(elements: Bytes) -> Bytes:
    """Decode red, green, blue and alpha from luma, two color differences, and alpha."""
    width = elements.shape[1] // 4
    plain, signed = (elements.view(f"<{kind}{width}").astype(np.int64) for kind in "ui")
    luma, alpha = plain[:, 0], plain[:, 3]
    orange, green = signed[:, 1], signed[:, 2]
    n_bits = np.frexp(alpha.astype(np.float64))[1]  # bits up to the highest set bit
    scale = np.maximum((1 << n_bits.astype(np.int64)) - 1, 1)
    kept = alpha & (scale >> 1)
    channels = [luma + orange - green, luma + green, luma - orange - green, kept << 1 | (kept & 1)]
    maximum = np.iinfo(f"u{width}").max
    scaled = _rounded(np.stack(channels, axis=1) * (maximum / scale)[:, np.newaxis])
    return np.clip(scaled, 0, maximum).astype(f"<u{width}").view(np.uint8)


def _rounded(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return values rounded to integers, halves away from zero."""
    integers: npt.NDArray[np.float64] = np.trunc(values + np.copysign(0.5, values))
    return integers


FILTERS: dict[str, Callable[[Bytes], Bytes]] = {
    "NONE": lambda elements: elements,
    "OCTAHEDRAL": _octahedral,
    "QUATERNION": _quaternion,
    "EXPONENTIAL": _exponential,
    "COLOR": _color,
}
