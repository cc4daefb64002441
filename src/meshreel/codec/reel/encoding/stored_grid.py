"""Detection of the grid to which positions were rounded, or near which they lie."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.reel.normative.grid import PositionGrid
from meshreel.codec.source import Source
from meshreel.model.extent import Extent

MIN_STEP = 8
"""Minimum step of a grid, in tolerances; a finer step is the rounding of decimal text."""

MAX_CELLS, MIN_GAIN = 64, 1.5
"""Limits of a coarse grid: cells along a side of the bounding box, and the ratio of its step to
twice the tolerance, the step without such a grid."""

N_SAMPLED = 64
"""Number of sampled positions, which exclude most coarse grids before all positions are read."""

TEXT_DIGITS = range(4, 8)
"""Significant digits to which text may have rounded a float."""


def grid_of_frame(source: Source) -> PositionGrid | None:
    """Return the grid on which the first frame lies, with its own origin; None without one."""
    grid = stored_grid(source.sequence.read(0, 1)[0])
    if grid is None:
        return None
    step, origin = grid
    frame = replace(source.frame, origin=origin)
    return PositionGrid(step / frame.scale, frame)


def stored_grid(vertices: npt.NDArray[np.floating]) -> tuple[float, tuple[float, ...]] | None:
    """Return the step, and a grid point near the center, of positions on a grid; None without one.

    Parameters
    ----------
    vertices : array of shape (V, 3)
        Positions that differ from points of a grid by at most `_tolerance`.
    """
    columns = [np.unique(column) for column in vertices.T]
    if sum(map(len, columns)) > len(vertices):
        return None
    tolerance = _tolerance(np.concatenate(columns))
    exact = [column.astype(np.float64) for column in columns]
    step = _common_step([column - column[0] for column in exact], 2.0 * tolerance)
    if step is None:
        return None
    origin = []
    for column in exact:
        offsets = column - np.rint((column - column[0]) / step) * step
        if np.ptp(offsets) > 2.0 * tolerance:
            return None
        offset = (offsets.min() + offsets.max()) / 2
        origin.append(offset + round((column[0] + column[-1] - 2 * offset) / 2 / step) * step)
    return step, tuple(map(float, origin))


def coarse_grid(
    n_frames: int, read: Callable[[int], npt.NDArray[np.floating]], extent: Extent, tolerance: float
) -> tuple[float, tuple[float, ...]] | None:
    """Return step and origin of the coarsest grid that divides the bounding box; None without one.

    Parameters
    ----------
    read : function of the number of a frame
        Returns its positions, of shape (V, 3). Frames after the first are only read if a sample of
        this one lies on a grid.
    extent : Extent
        Of all frames.
    tolerance : float
        Largest distance from the grid along an axis, in model units. Without such a grid, steps
        are twice as long.
    """
    low, size = extent.low, extent.high - extent.low
    steps = np.unique(size[:, None] / np.arange(1, MAX_CELLS + 1))[::-1]
    steps = steps[steps > MIN_GAIN * 2.0 * tolerance]
    first = read(0)
    sample = first[:: len(first) // N_SAMPLED + 1]
    for step in steps[_distances(sample - low, steps) <= tolerance]:
        if all(_distances(read(i) - low, step[None])[0] <= tolerance for i in range(n_frames)):
            origin = (low + np.rint(size / 2 / step) * step).astype(np.float32)
            return float(step), tuple(map(float, origin))
    return None


def _distances(offsets: Floats, steps: Floats) -> Floats:
    """Return the largest distance along an axis of offsets (N, 3) from the grid of each step."""
    cells = offsets / steps[:, None, None]
    distances: Floats = np.abs(cells - np.rint(cells)).max(axis=(1, 2)) * steps
    return distances


def _tolerance(values: npt.NDArray[np.floating]) -> float:
    """Half a unit of the last digit of the largest value, plus roundings to the number type.

    Text was usually written from float32.
    """
    largest = float(np.abs(values).max())
    rounding = 2.0 * float(np.finfo(values.dtype).eps) * largest
    for digits in TEXT_DIGITS:
        if all(values.dtype.type(f"{value:.{digits - 1}e}") == value for value in values):
            unit: float = 10.0 ** (np.floor(np.log10(largest or 1.0)) + 1 - digits)
            return unit / 2 + 2.0 * float(np.finfo(np.float32).eps) * largest
    return rounding


def _common_step(columns: list[Floats], tolerance: float) -> float | None:
    """Return the step of which all offsets are multiples, each within a tolerance."""
    offsets = np.unique(np.concatenate(columns))[1:]
    if not len(offsets):
        return None
    gap = min(float(np.diff(column).min(initial=np.inf)) for column in columns)
    low, high = gap - tolerance, gap + tolerance
    n_known = 0
    while n_known < len(offsets):
        if low <= MIN_STEP * tolerance / 2 or low > high:
            return None
        # Multiple k is unambiguous while its error, k (high - low) / 2, is below a quarter step.
        middle = (low + high) / 2
        n_clear = int(np.searchsorted(offsets, middle * middle / (high - low + 1e-300) / 2))
        if n_clear <= n_known:
            return None
        n_known = n_clear
        multiples = np.maximum(np.rint(offsets[:n_known] / middle), 1.0)
        low = max(low, float(((offsets[:n_known] - tolerance) / multiples).max()))
        high = min(high, float(((offsets[:n_known] + tolerance) / multiples).min()))
    if low > high:
        return None
    middle = (low + high) / 2
    numbers: list[Any] = [np.rint(column / middle) for column in columns]
    numbers = [number - number.mean() for number in numbers]
    square = sum(float(number @ number) for number in numbers)
    return sum(float(n @ c) for n, c in zip(numbers, columns, strict=True)) / square
