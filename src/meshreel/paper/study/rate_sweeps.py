"""Rate-distortion sweeps of equal density for all methods, refined until their envelopes settle."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from meshreel.paper.analysis import n_frequencies
from meshreel.paper.study.results import ERRORS, RATE, RateSweep, comparable, value_of
from meshreel.paper.sweeps import COEFFICIENTS, DEFAULTS, HIGH_BITS, Setting, limit_modes
from meshreel.studies.rate_distortion import Point, error_at_equal_rate, lower_envelope
from meshreel.studies.runs import Result

SETTLED_PERCENT = 2.0
"""A sweep ends when all its envelopes move by less, in percent of the error at equal rate."""

WINDOW = 4.0
"""Rates of refined points, from the inverse of this to this, in rates of PCA+qp in the tables."""

MAX_POINTS = 400
"""Points of a sweep that does not settle."""

ROW_RATIO, ANCHOR_RATIO, BLOCK_RATIO = 2**0.5, 2.0, 2.0
"""Steps of the axes: of rows, of anchors, and of the frames of a block; of bits it is 1."""

QUICK_ROUNDS = 1
"""Rounds of a quick study, which does not settle."""

CURVES = (
    ("pca", ""),
    ("pca-q", ""),
    ("v2v", ""),
    ("pca-qp", ""),
    ("pca-qp", COEFFICIENTS),
    ("blocks", ""),
    ("blocks", COEFFICIENTS),
    ("gft", ""),
)
"""Swept methods and choices; `pca-qs` has the quality of `pca-qp`."""

SHARES = 0.001, 0.16
BITS = 2, 16


@dataclass(frozen=True)
class Axis:
    """Values of an option: those of the tables and their neighbors, ascending."""

    name: str
    """The field of `Setting`."""
    values: tuple[Any, ...]

    def neighbors(self, setting: Setting) -> list[Setting]:
        """The settings one step away."""
        place = self.values.index(getattr(setting, self.name))
        places = [other for other in (place - 1, place + 1) if 0 <= other < len(self.values)]
        return [replace(setting, **{self.name: self.values[other]}) for other in places]


def starts(n_frames: int, n_verts: int, methods: Sequence[str]) -> list[Setting]:
    """The settings of the tables from which the sweeps of these methods begin."""
    found = []
    for method, choices in CURVES:
        if method in methods:
            setting = replace(DEFAULTS.setting(method), choices=choices)
            if method == "gft":
                setting = replace(setting, n_modes=n_frequencies(None, n_verts))
            found.append(limit_modes(setting, n_frames))
    return found


def axes_of(start: Setting, n_frames: int, n_verts: int) -> list[Axis]:
    """The axes of a sweep: rows and bits, and if the method has them, anchors and blocks."""
    method, n_rows = start.method, n_verts if start.method == "gft" else n_frames
    assert start.n_modes is not None  # `starts` chooses it
    bits = range(BITS[0], BITS[1] + 1)
    if method == "pca":  # its coefficients are not quantized coarsely
        bits = range(HIGH_BITS - 4, HIGH_BITS + 1)
    axes = [
        Axis("n_modes", geometric(start.n_modes, ROW_RATIO, 1, n_rows)),
        Axis("bits", tuple(bits)),
    ]
    if start.anchors:
        axes.append(Axis("anchors", geometric(start.anchors, ANCHOR_RATIO, *SHARES)))
    if start.block_frames:
        frames = geometric(start.block_frames, BLOCK_RATIO, 2, n_frames)
        axes.append(Axis("block_frames", frames))
    return axes


def geometric(start: Any, ratio: float, low: float, high: float) -> tuple[Any, ...]:
    """The multiples of a number by powers of a ratio within a range, ascending, whole if it is."""
    found = {start}
    for step in (ratio, 1 / ratio):
        value = start * step
        while low <= value <= high:
            found.add(round(value) if isinstance(start, int) else value)
            value *= step
    return tuple(sorted(found))


def swept(
    start: Setting,
    axes: Sequence[Axis],
    measure: Callable[[Setting], Result],
    window: tuple[float, float],
    *,
    is_quick: bool = False,
) -> RateSweep:
    """Measure a setting and the neighbors of the best points, until the envelopes settle.

    Every round measures the neighbors along all axes of the points on the convex hulls of log error
    over log rate, for KG, STED and NMSVE. The sweep ends when a round extends no envelope within
    the window of rates and moves none by 2 % on average.

    Parameters
    ----------
    measure : callable
        Returns the result of a setting, which may be refused.
    window : tuple of 2 floats
        Lowest and highest rate of points whose neighbors are measured.
    is_quick : bool
        Stop after one round.
    """
    results = {start: measure(start)}
    n_rounds, moved = 0, math.inf
    while moved >= SETTLED_PERCENT:
        if (is_quick and n_rounds == QUICK_ROUNDS) or len(results) >= MAX_POINTS:
            return RateSweep(start.label, [*results.values()], None, window)
        before = _curves(results.values())
        # The start may be outside: pca with 16 bits has high rates.
        for setting in _on_hulls(results, window) or _on_hulls(results, (0.0, math.inf)):
            for neighbor in chain.from_iterable(axis.neighbors(setting) for axis in axes):
                if neighbor not in results and _is_possible(neighbor):
                    results[neighbor] = measure(neighbor)
        moved = _moved_percent(before, _curves(results.values()), window)
        n_rounds += 1
    return RateSweep(start.label, [*results.values()], moved, window)


def window_around(rate: float) -> tuple[float, float]:
    """The rates whose points are refined, given that of PCA+qp in the tables."""
    return rate / WINDOW, rate * WINDOW


def _is_possible(setting: Setting) -> bool:
    return setting.method == "gft" or (setting.n_modes or 1) <= (setting.block_frames or math.inf)


def _curves(results: Iterable[Result]) -> dict[str, list[Point]]:
    """The envelope of each error."""
    found = comparable(results)
    return {
        name: lower_envelope([(result[RATE], value_of(result, name)) for result in found])
        for name in ERRORS
    }


def _on_hulls(results: Mapping[Setting, Result], window: tuple[float, float]) -> list[Setting]:
    """The settings within a window of rates on the convex hull of any error."""
    hulls = {name: lower_hull(points) for name, points in _curves(results.values()).items()}
    return [
        setting
        for setting, result in results.items()
        if "refused" not in result
        and window[0] <= result[RATE] <= window[1]
        and any((result[RATE], value_of(result, name)) in hulls[name] for name in ERRORS)
    ]


def lower_hull(envelope: Sequence[Point]) -> list[Point]:
    """The points of an envelope on its lower convex hull, in logarithms of rate and error."""
    hull: list[Point] = []
    for point in envelope:
        while len(hull) > 1 and _turns_down(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    return hull


def _turns_down(first: Point, middle: Point, last: Point) -> bool:
    """Whether the middle one is on or above the line between the others, in logarithms."""
    (x, y), (x_1, y_1), (x_2, y_2) = np.log([first, middle, last]).tolist()
    return bool((x_1 - x) * (y_2 - y) <= (x_2 - x) * (y_1 - y))


def _moved_percent(
    before: Mapping[str, Sequence[Point]],
    after: Mapping[str, Sequence[Point]],
    window: tuple[float, float],
) -> float:
    """By how much the error at equal rate fell, of the error that fell most, in percent.

    Infinite if an envelope became longer within the window, by 2 % in rate and in error.
    """
    moves = [0.0]
    for name, points in before.items():
        if _extends(points, after[name], window):
            return math.inf
        moves.append(-(error_at_equal_rate(after[name], points).percent or 0.0))
    return max(moves)


def _extends(points: Sequence[Point], longer: Sequence[Point], window: tuple[float, float]) -> bool:
    """Whether an envelope has new ends within the window of rates."""
    if not points or not longer:
        return bool(longer)
    factor = 1 + SETTLED_PERCENT / 100
    low, high = points[0], points[-1]
    starts_earlier = low[0] > window[0] and longer[0][0] * factor < low[0]
    ends_later = high[0] < window[1] and longer[-1][1] * factor < high[1]
    return starts_earlier or ends_later
