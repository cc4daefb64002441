"""Floats that are integers by a number that many share, as numbers in files often are."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int32]

MOST_PLACES = 9
"""Most decimal places."""

BY_BYTE, BY_SHORT = 10, 11
"""Codes of 1 / 255 and 1 / 65535; those up to `MOST_PLACES` are numbers of decimal places."""

GRID = 64
"""Code of the grid of whole numbers; those behind it are of grids of 1/2, 1/4, ..."""

MAX_GRID_BITS = 24
"""Finest grid of 2^-bits; every number of it up to 1 is exact in float32."""

LARGEST = 1 << 29
"""Largest integer."""


def divisor(code: int) -> float:
    """By what integers are divided that are written with one of `CODES`."""
    if code >= GRID:
        return 2.0 ** (code - GRID)
    return {BY_BYTE: 255.0, BY_SHORT: 65535.0}.get(code) or 10.0**code


def values_of(integers: Integers, code: int, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """The floats that integers stand for."""
    # One division of exact numbers and one rounding: the same on every machine.
    return (integers / divisor(code)).astype(dtype)


def as_multiples(values: npt.NDArray[Any]) -> Iterator[tuple[int, Integers]]:
    """Codes and integers that give exactly these floats: of each family the coarsest."""
    if values.dtype.kind != "f" or not np.isfinite(values).all():
        return
    exact = values.astype(np.float64)
    grids = range(GRID, GRID + MAX_GRID_BITS + 1)
    for family in (range(MOST_PLACES + 1), (BY_BYTE, BY_SHORT), grids):
        for code in family:
            integers = _integers(values, exact, code)
            if integers is not None:
                yield code, integers
                break


def _integers(values: npt.NDArray[Any], exact: npt.NDArray[Any], code: int) -> Integers | None:
    with np.errstate(over="ignore"):
        rounded = np.rint(exact * divisor(code))
    if not (np.abs(rounded) <= LARGEST).all():
        return None
    integers = rounded.astype(np.int32)
    back = values_of(integers, code, values.dtype)
    return integers if back.tobytes() == values.tobytes() else None
