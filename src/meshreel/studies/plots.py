"""Plots of studies: rate-distortion curves, styles of methods and codecs, axes and legends."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from meshreel.studies.rate_distortion import Point, lower_envelope

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.lines import Line2D

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
"""Our methods, in Okabe and Ito's palette, which color-blind readers can distinguish."""

CODECS = {
    "draco": ("#7A4A2B", "s"),
    "sz3": ("#7F7F1F", "^"),
    "zfp": ("#8C8C8C", "D"),
    "meshopt": ("#B0518A", "v"),
    "pco": ("#3B7D80", "P"),
    "fpzip": ("#8E5572", "*"),
    "famc": ("#1F1F5F", "X"),
    "vdmc_tm4_motion": ("#3FA34D", "<"),
    "gltfpack_cc": ("#A0785A", ">"),
    "o3dgc_dv": ("#8899AA", "h"),
    "o3dgc_sc3dmc": ("#5F7F9F", "p"),
}
"""Other codecs: colors, muted so that our methods stand out, and markers; ours are discs."""

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
    lines: list[tuple[float, Line2D]] = []
    for label, points in curves.items():
        style, envelope, name = line_style(label), lower_envelope(points), label.replace("_", " ")
        marker = CODECS.get(codec_of(label), ("", "o"))[1]
        axes.plot(*np.array(points).T, marker, color=style["color"], markersize=3, alpha=0.4)
        if envelope:
            [line] = axes.plot(
                *np.array(envelope).T, marker=marker, markersize=5, label=name, **style
            )
            lines.append((float(np.median([rate for rate, _ in envelope])), line))
    axes.set(xscale="log", yscale="log", xlabel=rate_name, ylabel=error_name)
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    tidy(axes)
    list_lines(axes, [line for _, line in sorted(lines, key=lambda pair: pair[0])])


def list_lines(axes: "Axes", lines: Sequence["Line2D"]) -> None:
    """Add a legend in the right margin, in the colors of the lines."""
    axes.legend(
        handles=lines, loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False,
        fontsize=FONT_SIZE, labelcolor="linecolor", handlelength=3,
    )  # fmt: skip


def plain_ticks(axis: "Axis") -> None:
    """Put plain numbers such as 0.5 and 2e-05 on a log axis: 1, 2 and 5 of each decade, or more."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    low, high = axis.get_view_interval()
    subs = (1, 2, 5) if high > 10 * low else (1, 1.5, 2, 3, 4, 5, 6, 8)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def tidy(axes: "Axes") -> None:
    """Add a light grid and remove the top and right borders."""
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)


def codec_of(label: str) -> str:
    """The codec of a label, such as "sz3" of "sz3_lorenzo_2d (recorded)"."""
    name = label.partition(" ")[0]
    return name if name in CODECS or name in METHOD_COLORS else name.partition("_")[0]


def line_style(label: str) -> dict[str, Any]:
    """Matplotlib line style of a variant or another codec.

    `pca-qs` is wide, so that it is visible below `pca-qp`, with which it coincides. Variants with
    non-default anchors and recorded codecs are dashed.
    """
    codec, is_wide = codec_of(label), label.startswith("pca-qs")
    width = 1.1 if codec not in METHOD_COLORS else 5.0 if is_wide else 1.5
    return {
        "color": METHOD_COLORS.get(codec) or CODECS.get(codec, ("#666666", ""))[0],
        "linewidth": width,
        "alpha": 0.45 if is_wide else 1.0,
        "linestyle": "--" if " " in label else "-",
    }
