"""Axes of rate-distortion plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from meshreel.evaluation.plots.labels import FONT_SIZE
from meshreel.evaluation.plots.palette import line_style, point_marker
from meshreel.evaluation.rate_distortion import Point, lower_envelope

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.lines import Line2D


def draw_envelopes(
    axes: "Axes",
    curves: Mapping[str, Sequence[Point]],
    error_name: str,
    rate_name: str = "bits per vertex and frame",
) -> None:
    """Draw the points (rate, error) of each label and their lower envelope on log axes.

    The legend lists the envelopes by ascending rate.
    """
    rates: dict[str, float] = {}
    lines: dict[str, Line2D] = {}
    for label, points in curves.items():
        style = line_style(label)
        envelope = lower_envelope(points)
        marker = point_marker(label)
        axes.plot(*np.array(points).T, marker, color=style["color"], markersize=3, alpha=0.4)
        if envelope:
            (lines[label],) = axes.plot(*np.array(envelope).T, marker=marker, markersize=5, **style)
            rates[label] = float(np.median([rate for rate, _ in envelope]))
    axes.set(xscale="log", yscale="log", xlabel=rate_name, ylabel=error_name)
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    tidy(axes)
    # Not labels at the ends of the lines: their leaders would cross, because lines end anywhere.
    labels = sorted(rates, key=lambda label: rates[label])
    axes.legend(
        [lines[label] for label in labels], labels,
        loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False, fontsize=FONT_SIZE,
        labelcolor="linecolor", handlelength=3,
    )  # fmt: skip


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
