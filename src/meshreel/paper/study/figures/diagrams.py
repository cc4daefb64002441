"""Plots of results: Fig. 4, Fig. 5 and rate-distortion plots."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshreel.evaluation.plots import LineEnd, draw_envelopes, label_ends, line_style, tidy
from meshreel.evaluation.runs.store import Result, done
from meshreel.paper.study.figures.panels import save_for_print
from meshreel.paper.study.results import PaperResults, label_of_result, method_of_result
from meshreel.rendering.documents import Picture
from meshreel.rendering.plots import blank_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

MIN_LOG_RATIO = 8.0
"""Values are drawn on a log axis if the largest exceeds the smallest by this factor."""

ROW_AXES = {
    "": ("all frames in one block", "row (eigen-trajectory)"),
    "blocks": (
        "blocks of {block_frames} frames",
        "row (eigen-trajectory) of all blocks",
    ),
    "gft": ("each frame separately", "row (graph frequency)"),
}
"""Titles and horizontal axes of Fig. 5."""

SCIENTIFIC_BELOW = 1e-3
"""Axes that extend below this are labeled with powers of ten."""

ERRORS = (
    ("kg_error_percent", "KG error (%)"),
    ("sted", "STED"),
    ("nmsve_mean", "NMSVE, mean over frames"),
)


def draw_error_per_frame(results: PaperResults, folder: Path) -> Picture:
    """Fig. 4: NMSVE of every frame for all variants."""
    from matplotlib.ticker import MaxNLocator

    figure = blank_figure(8, 4.2)
    axes = figure.add_subplot()
    ends: list[LineEnd] = []
    values = []
    for result in done(results.variants):
        errors = np.array(result["quality"]["nmsve"], float)
        label = label_of_result(result)
        frames = np.arange(len(errors))
        marker = "o" if len(errors) == 1 else None
        axes.plot(frames, errors, marker=marker, **line_style(label))
        ends.append((label, float(frames[-1]), float(errors[-1])))
        values.append(errors)
    _scale_axis(axes, np.concatenate(values))
    axes.set(xlabel="frame", ylabel="NMSVE")
    axes.margins(x=0.01)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
    if len(errors) == 1:
        axes.set_xticks([0])
    tidy(axes)
    label_ends(axes, ends)
    path = folder / f"{results.slug}-fig4-nmsve.png"
    save_for_print(figure, path)
    caption = (
        "NMSVE of every frame, all variants at the settings of the tables. Positions are divided "
        "by the diagonal of the first frame's bounding box. Rates differ: Table I has them."
    )
    methods = {method_of_result(result) for result in done(results.variants)}
    if {"pca-qs", "pca-qp"} <= methods:
        caption += " The wide line of `pca-qs` is drawn under that of `pca-qp`."
    return Picture(path, "Fig. 4", caption, 1)


def draw_bits_per_row(results: PaperResults, folder: Path) -> Picture:
    """Fig. 5: bits of an entry in each row of coefficients, for all variants."""
    from matplotlib.ticker import MaxNLocator

    groups: dict[str, list[Result]] = {}
    for result in done(results.variants):
        method = method_of_result(result)
        groups.setdefault(method if method in ROW_AXES else "", []).append(result)
    figure = blank_figure(8, 0.4 + 2.7 * len(groups))
    for number, (name, group) in enumerate(groups.items(), 1):
        axes = figure.add_subplot(len(groups), 1, number)
        ends: list[LineEnd] = []
        for labels, result in _group_equal_rows(group):
            _draw_rows(axes, labels, result, ends)
        title, rows = ROW_AXES[name]
        title = title.format(**group[0]["identity"]["setting"])
        pad = 16 if name == "blocks" else 6  # above the numbers of the blocks
        axes.set_title(title, loc="left", fontsize=10, pad=pad)
        unit = "frame" if name == "gft" else "vertex"  # a frequency has a coefficient per frame
        axes.set(xlabel=rows, ylabel=f"bits per {unit}")
        axes.margins(y=0.08)
        axes.set_ylim(bottom=0)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
        tidy(axes)
        label_ends(axes, ends)
    path = folder / f"{results.slug}-fig5-bits-per-row.png"
    save_for_print(figure, path)
    caption = (
        "Mean bits of an entry in each row of coefficients, entropy-coded separately; mean of x, y "
        "and z. With one quantization step for all rows, bits follow the energy of a row. Rows "
        "beyond the axis take no bits. Variants with a common label have the same coefficients."
    )
    if "blocks" in groups:
        caption += " Shading separates the blocks of `blocks`."
    return Picture(path, "Fig. 5", caption, len(groups))


def draw_rate_distortion(results: PaperResults, folder: Path) -> Picture:
    """Rate against KG error, STED and mean NMSVE, with the lower envelope of each method."""
    # Vertically stacked, because labels of variants with other choices are long.
    figure = blank_figure(8, 9)
    figure.set_layout_engine("constrained", hspace=0.05)
    for number, (key, name) in enumerate(ERRORS, 1):
        axes = figure.add_subplot(len(ERRORS), 1, number)
        draw_envelopes(axes, results.points(key), name)
        _tick(axes.yaxis)
    path = folder / f"{results.slug}-rate-distortion.png"
    save_for_print(figure, path)
    caption = (
        "Three errors over the rate of the whole file, without the order of vertices and faces. "
        "Each point is a stream. A line connects the Pareto-optimal streams of a method; the "
        "others are small points."
    )
    return Picture(path, "Rate and distortion", caption, len(ERRORS))


def _group_equal_rows(group: Sequence[Result]) -> list[tuple[str, Result]]:
    """Results with distinct rows, each with the labels of all results that share them."""
    labeled: list[tuple[str, Result]] = []
    for result in group:
        label = label_of_result(result)
        for number, (labels, other) in enumerate(labeled):
            if other["bits_per_row"] == result["bits_per_row"]:
                labeled[number] = (f"{labels},\n{label}", result)
                break
        else:
            labeled.append((label, result))
    return labeled


def _draw_rows(axes: "Axes", labels: str, result: Result, ends: list[LineEnd]) -> None:
    """Draw the rows of a variant, and append its label and the end of its line to `ends`."""
    style, position = line_style(label_of_result(result)), 0
    n_blocks = len(result["bits_per_row"])
    for number, rows in enumerate(result["bits_per_row"], 1):
        bits = np.mean(rows, axis=0)
        xs = np.arange(position, position + len(bits)) + 1
        axes.plot(xs, bits, marker="o" if len(bits) < 60 else None, markersize=3, **style)
        if number % 2 == 0:
            axes.axvspan(xs[0] - 0.5, xs[-1] + 0.5, color="#000000", alpha=0.06, lw=0)
        if 1 < n_blocks <= 12:
            axes.text(
                float(xs.mean()), 1.01, f"block {number}",
                transform=axes.get_xaxis_transform(), ha="center", fontsize=8, color="#666666",
            )  # fmt: skip
        position += len(bits)
    axes.set_xlim(0.5, position + 0.5)
    ends.append((labels, float(position), float(bits[-1])))


def _scale_axis(axes: "Axes", values: "np.typing.ArrayLike") -> None:
    """Use a log axis if the values span a large enough range, else a linear one from zero."""
    positive = np.asarray(values, float)
    positive = positive[positive > 0]
    if positive.size and positive.max() > MIN_LOG_RATIO * positive.min():
        axes.set_yscale("log")
        axes.set_ylim(positive.min() / 1.2, positive.max() * 1.2)
        _tick(axes.yaxis)
    else:
        axes.set_ylim(bottom=0)


def _tick(axis: "Axis") -> None:
    """Label a log axis at 1, 2 and 5 of each decade, or more densely within one decade."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    within_decade = high < 10 * low
    subs = (1, 1.5, 2, 3, 4, 5, 6, 8) if within_decade else (1, 2, 5)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_minor_formatter(NullFormatter())
    scientific = low < SCIENTIFIC_BELOW

    def label(value: float, _: object) -> str:
        if not scientific:
            return f"{value:g}"
        mantissa, exponent = f"{value:.1e}".split("e")
        return rf"${float(mantissa):g}\times10^{{{int(exponent)}}}$"

    axis.set_major_formatter(FuncFormatter(label))
