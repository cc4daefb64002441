"""Floats that are integers divided by a common divisor, as numbers in files often are."""

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


def divisor(code: int) -> float:
    """Divisor of the integers that are stored with this code."""
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
    back = values_of(integers, code, values.dtype)
    return integers if back.tobytes() == values.tobytes() else None
