"""Floats that are integers divided by a common divisor, or on a grid, as in many files."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int32]

MAX_DECIMALS = 9

UNORM8, UNORM16 = 10, 11
"""Codes of the divisors 255 and 65535; codes up to `MAX_DECIMALS` count decimal places."""

GRID = 64
"""Code of the grid of whole numbers; the next codes are grids of 1/2, 1/4, ..."""

MAX_GRID_BITS = 24
"""Finest grid, of 2^-bits; float32 represents all of its numbers up to 1."""

MAX_INTEGER = 1 << 29

OFFSET_GRID = 12
"""Code of a grid whose step and origins are stored, such as that of Draco's quantization."""

QUANTIZED_BITS = range(4, 21)
"""Bits of such grids."""

N_SAMPLED_ROWS = 64
"""Number of rows on which a grid is tested first."""


def divisor(code: int) -> float:
    """Divisor of integers with this code."""
    if code >= GRID:
        return 2.0 ** (code - GRID)
    return {UNORM8: 255.0, UNORM16: 65535.0}.get(code) or 10.0**code


def values_of(integers: Integers, code: int, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """Floats that integers with this code represent."""
    # One division of exact numbers and one rounding: the same on every machine.
    return (integers / divisor(code)).astype(dtype)


def as_multiples(values: npt.NDArray[Any]) -> Iterator[tuple[int, Integers]]:
    """Yield codes and integers that represent these floats exactly: the coarsest of each family."""
    if values.dtype.kind != "f" or not np.isfinite(values).all():
        return
    exact = values.astype(np.float64)
    grids = range(GRID, GRID + MAX_GRID_BITS + 1)
    for family in (range(MAX_DECIMALS + 1), (UNORM8, UNORM16), grids):
        for code in family:
            integers = _integers(values, exact, code)
            if integers is not None:
                yield code, integers
                break


def _integers(values: npt.NDArray[Any], exact: npt.NDArray[Any], code: int) -> Integers | None:
    with np.errstate(over="ignore"):
        rounded = np.rint(exact * divisor(code))
    if not (np.abs(rounded) <= MAX_INTEGER).all():
        return None
    integers = rounded.astype(np.int32)
    restored = values_of(integers, code, values.dtype)
    return integers if restored.tobytes() == values.tobytes() else None


def as_offset_grid(values: npt.NDArray[Any]) -> Iterator[tuple[bytes, Integers]]:
    """Yield the step and origins, and integers, that represent these floats exactly; or nothing.

    A quantizer of b bits divides the widest range of a column into 2^b - 1 steps, and rounds
    products and sums to single precision, as Draco does.

    Parameters
    ----------
    values : array of shape (N, C)
    """
    if values.dtype != np.float32 or not len(values) or not np.isfinite(values).all():
        return
    low = values.min(axis=0)
    with np.errstate(over="ignore"):
        width = (values.max(axis=0) - low).max()
    for bits in QUANTIZED_BITS if 0 < width < np.inf else ():
        step = width / np.float32(2**bits - 1)  # may underflow to 0
        if not step or _on_grid(values[:N_SAMPLED_ROWS], low, step) is None:
            continue
        integers = _on_grid(values, low, step)
        if integers is not None:
            yield np.append(step, low).astype("<f4").tobytes(), integers
            return


def _on_grid(
    values: npt.NDArray[np.float32], low: npt.NDArray[np.float32], step: np.float32
) -> Integers | None:
    """Return the integers of values on a grid, or None if they are not all on it."""
    with np.errstate(over="ignore", invalid="ignore"):
        integers = np.rint((values.astype(np.float64) - low) / step).astype(np.int32)
        restored = low + integers.astype(np.float32) * step
    return integers if restored.tobytes() == values.tobytes() else None
