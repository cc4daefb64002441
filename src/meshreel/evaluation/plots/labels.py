"""Labels at the ends of lines, without overlap."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshreel.evaluation.plots.palette import line_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LineEnd = tuple[str, float, float]
"""A label and the last point of its line in data coordinates."""

FONT_SIZE = 9


def label_ends(axes: "Axes", ends: Sequence[LineEnd]) -> None:
    """Write labels in the right margin, each at about the height of its line's end.

    Parameters
    ----------
    axes : matplotlib axes
        With its limits set.
    ends : sequence of (label, x, y)
        The last point of each line, in data coordinates.
    """
    axes.get_xlim(), axes.get_ylim()  # evaluates automatic limits
    to_axes = axes.transAxes.inverted()
    points = [to_axes.transform(axes.transData.transform((x, y))) for _, x, y in ends]
    # Zeros on a log axis and undefined errors are labeled at the bottom.
    points = [np.nan_to_num(point, nan=0.0, posinf=1.0, neginf=0.0) for point in points]
    line_height = FONT_SIZE * 1.35 / (72 * axes.get_window_extent().height / axes.figure.dpi)
    n_lines = [label.count("\n") + 1 for label, _, _ in ends]
    heights = spread([float(point[1]) for point in points], [line_height * n for n in n_lines])
    for (label, _, _), (x, y), height in zip(ends, points, heights, strict=True):
        color = line_style(label.splitlines()[-1])["color"]
        axes.plot(
            [x + 0.008, 1.0, 1.03],
            [y, height if x < 0.9 else y, height],
            transform=axes.transAxes, clip_on=False, color="#888888", linewidth=0.6,
            linestyle=":",
        )  # fmt: skip
        axes.text(
            1.035, height, label,
            transform=axes.transAxes, va="center", color=color, fontsize=FONT_SIZE,
        )  # fmt: skip


def spread(centers: Sequence[float], sizes: Sequence[float]) -> list[float]:
    """Move intervals as little as possible so that they do not overlap.

    All stay within 0..1 if they fit.

    Parameters
    ----------
    centers, sizes : sequence of float
        Preferred center and length of each interval.
    """
    order = sorted(range(len(centers)), key=lambda number: centers[number])
    groups: list[_Group] = []
    for number in order:
        groups.append(_clamp(_Group([number], centers[number], sizes[number])))
        while len(groups) > 1 and groups[-2].top > groups[-1].bottom:
            above = groups.pop()
            below = groups.pop()
            groups.append(_clamp(_merge(below, above)))
    positions = [0.0] * len(centers)
    for group in groups:
        bottom = group.bottom
        for number in group.members:
            positions[number] = bottom + sizes[number] / 2
            bottom += sizes[number]
    return positions


@dataclass(frozen=True)
class _Group:
    """Adjacent intervals, from the lowest."""

    members: list[int]
    center: float
    size: float

    @property
    def bottom(self) -> float:
        return self.center - self.size / 2

    @property
    def top(self) -> float:
        return self.center + self.size / 2


def _clamp(group: _Group) -> _Group:
    """Move the group into 0..1, or center it if it is larger."""
    half = group.size / 2
    center = min(max(group.center, half), 1 - half) if group.size < 1 else 0.5
    return _Group(group.members, center, group.size)


def _merge(below: _Group, above: _Group) -> _Group:
    """Merge two groups at the mean of their centers, weighted by members."""
    n_below, n_above = len(below.members), len(above.members)
    center = (below.center * n_below + above.center * n_above) / (n_below + n_above)
    return _Group(below.members + above.members, center, below.size + above.size)
