"""Names written beside lines, moved apart where they would lie on each other."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from meshreel.evaluation.plots.palette import line_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LineEnd = tuple[str, float, float]
"""A name, and the last point of its line in data coordinates."""

FONT_SIZE = 9


def label_ends(axes: "Axes", ends: Sequence[LineEnd]) -> None:
    """Write names in the right margin, each at the height of its line's end.

    Parameters
    ----------
    axes : matplotlib axes
        With its limits set; a margin on the right is left to the names.
    ends : sequence of (label, x, y)
        The last point of each line, in data coordinates.
    """
    axes.get_xlim(), axes.get_ylim()  # settles limits that are still to be found
    places = axes.transAxes.inverted()
    shown = [places.transform(axes.transData.transform((x, y))) for _, x, y in ends]
    # Zero on a log axis, and errors without a measure, are labelled at the bottom.
    shown = [np.nan_to_num(place, nan=0.0, posinf=1.0, neginf=0.0) for place in shown]
    line_height = FONT_SIZE * 1.35 / (72 * axes.get_window_extent().height / axes.figure.dpi)
    n_lines = [label.count("\n") + 1 for label, _, _ in ends]
    heights = spread([float(place[1]) for place in shown], [line_height * n for n in n_lines])
    for (label, _, _), (x, y), height in zip(ends, shown, heights, strict=True):
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


def spread(heights: Sequence[float], needed: Sequence[float]) -> list[float]:
    """Move heights as little as gives each the room it needs, in the order given.

    All stay within 0..1 if they fit.

    Parameters
    ----------
    heights : sequence of float
        The best center of each.
    needed : sequence of float
        The room of each.
    """
    order = sorted(range(len(heights)), key=lambda number: heights[number])
    groups: list[_Group] = []
    for number in order:
        groups.append(_inside(_Group([number], heights[number], needed[number])))
        while len(groups) > 1 and groups[-2].top > groups[-1].bottom:
            above = groups.pop()
            below = groups.pop()
            groups.append(_inside(_joined(below, above)))
    placed = [0.0] * len(heights)
    for group in groups:
        bottom = group.bottom
        for number in group.members:
            placed[number] = bottom + needed[number] / 2
            bottom += needed[number]
    return placed


@dataclass(frozen=True)
class _Group:
    """Labels that touch each other, from the lowest."""

    members: list[int]
    centre: float
    room: float

    @property
    def bottom(self) -> float:
        return self.centre - self.room / 2

    @property
    def top(self) -> float:
        return self.centre + self.room / 2


def _inside(group: _Group) -> _Group:
    """The group moved into 0..1; centered if it is larger."""
    half = group.room / 2
    centre = min(max(group.centre, half), 1 - half) if group.room < 1 else 0.5
    return _Group(group.members, centre, group.room)


def _joined(below: _Group, above: _Group) -> _Group:
    """Both at their common centre, by members."""
    n_below, n_above = len(below.members), len(above.members)
    centre = (below.centre * n_below + above.centre * n_above) / (n_below + n_above)
    return _Group(below.members + above.members, centre, below.room + above.room)
