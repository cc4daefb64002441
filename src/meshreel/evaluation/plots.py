"""Rate-distortion plots: axes, labels at the ends of lines, and styles of methods and codecs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes


from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from meshreel.evaluation.rate_distortion import Point, lower_envelope

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.lines import Line2D


# Okabe and Ito's palette, which color-blind readers can distinguish.
METHOD_COLORS = {
    "pca": "#56B4E9",
    "pca-q": "#0072B2",
    "v2v": "#E69F00",
    "pca-qs": "#CC79A7",
    "pca-qp": "#D55E00",
    "blocks": "#009E73",
    "gft": "#000000",
    "reel": "#4B0092",
    "reel-geometry": "#A679D2",
    "lossless": "#1B7F79",
    "grid": "#5C7A29",
}

# Muted, so that our methods stand out.
CODEC_COLORS = {
    "draco": "#7A4A2B",
    "sz3": "#7F7F1F",
    "zfp": "#8C8C8C",
    "meshopt": "#B0518A",
    "pco": "#3B7D80",
    "fpzip": "#8E5572",
    "famc": "#1F1F5F",
    "vdmc_tm4_motion": "#6B8E23",
    "gltfpack_cc": "#A0785A",
    "o3dgc_dv": "#8899AA",
    "o3dgc_sc3dmc": "#5F7F9F",
}


# Shapes distinguish codecs in print and for color-blind readers; our methods are discs.
CODEC_MARKERS = {
    "draco": "s",
    "sz3": "^",
    "zfp": "D",
    "meshopt": "v",
    "pco": "P",
    "fpzip": "*",
    "famc": "X",
    "vdmc_tm4_motion": "<",
    "gltfpack_cc": ">",
    "o3dgc_dv": "h",
    "o3dgc_sc3dmc": "p",
}

LineEnd = tuple[str, float, float]
"""A label and the last point of its line in data coordinates."""

FONT_SIZE = 9


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


def line_style(label: str) -> dict[str, Any]:
    """Matplotlib line style of a variant or another codec.

    `pca-qs` is wide, so that it is visible below `pca-qp`, with which it coincides. Variants with
    non-default anchors and recorded codecs are dashed. A codec recorded under a longer name
    (`sz3_lorenzo_2d`) looks like the measured codec.
    """
    method, _, remark = label.partition(" ")
    is_wide = method == "pca-qs"
    codec = method if method in CODEC_COLORS else method.split("_")[0]
    color, width = CODEC_COLORS.get(codec, "#666666"), 1.1
    if method in METHOD_COLORS:
        color, width = METHOD_COLORS[method], 5.0 if is_wide else 1.5
    return {
        "color": color,
        "linewidth": width,
        "alpha": 0.45 if is_wide else 1.0,
        "linestyle": "--" if remark else "-",
    }


def point_marker(label: str) -> str:
    """Matplotlib marker of a variant or another codec."""
    method = label.partition(" ")[0]
    return CODEC_MARKERS.get(method) or CODEC_MARKERS.get(method.split("_")[0], "o")


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
