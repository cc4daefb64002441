"""Axes of rate-distortion plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from meshreel.evaluation.plots.labels import LineEnd, label_ends
from meshreel.evaluation.plots.palette import line_style, point_marker
from meshreel.evaluation.rate_distortion import Point, lower_envelope

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis


def draw_envelopes(
    axes: "Axes",
    curves: Mapping[str, Sequence[Point]],
    error_name: str,
    rate_name: str = "bits per vertex and frame",
) -> None:
    """Draw the points (rate, error) of each label and their lower envelope on log axes."""
    ends: list[LineEnd] = []
    for label, points in curves.items():
        style = line_style(label)
        envelope = lower_envelope(points)
        marker = point_marker(label)
        axes.plot(*np.array(points).T, marker, color=style["color"], markersize=3, alpha=0.4)
        if envelope:
            axes.plot(*np.array(envelope).T, marker=marker, markersize=5, **style)
            ends.append((label, *envelope[-1]))
    axes.set(xscale="log", yscale="log", xlabel=rate_name, ylabel=error_name)
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    tidy(axes)
    label_ends(axes, ends)


def plain_ticks(axis: "Axis") -> None:
    """Put plain numbers such as 0.5 and 2e-05 at 1, 2 and 5 of each decade of a log axis."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def tidy(axes: "Axes") -> None:
    """Add a light grid and remove the top and right borders."""
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
