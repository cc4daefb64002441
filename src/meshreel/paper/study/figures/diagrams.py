"""Plots of results: Fig. 4, Fig. 5 and rate-distortion plots."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshreel.paper.study.results import PaperResults, label_of_result, method_of_result
from meshreel.rendering.documents import Picture
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.studies.plots import draw_envelopes, line_style, list_lines, plain_ticks, tidy
from meshreel.studies.runs import Result, usable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

DPI = 240

MIN_LOG_RATIO = 8.0
"""Values are drawn on a log axis if the largest exceeds the smallest by this factor."""

ROW_AXES = {
    "": ("all frames in one block", "row (eigen-trajectory)"),
    "blocks": ("blocks of {block_frames} frames", "row (eigen-trajectory) of all blocks"),
    "gft": ("each frame separately", "row (graph frequency)"),
}
"""Titles and horizontal axes of Fig. 5."""

ERRORS = (
    ("KG", "KG error (%)"),
    ("STED", "STED"),
    ("NMSVE", "NMSVE, mean over frames"),
)


def draw_error_per_frame(results: PaperResults, folder: Path) -> Picture:
    """Fig. 4: NMSVE of every frame for all variants."""
    figure = blank_figure(8, 4.2)
    axes = figure.add_subplot()
    measured = usable(results.variants)
    errors = [np.array(result["quality"]["nmsve"], float) for result in measured]
    for result, values in zip(measured, errors, strict=True):
        label, marker = label_of_result(result), "o" if len(values) == 1 else None
        axes.plot(values, marker=marker, label=label, **line_style(label))
    positive = np.concatenate(errors)
    positive = positive[positive > 0]
    if positive.size and positive.max() > MIN_LOG_RATIO * positive.min():
        axes.set_yscale("log")
        plain_ticks(axes.yaxis)
    else:
        axes.set_ylim(bottom=0)
    axes.set(xlabel="frame", ylabel="NMSVE")
    axes.margins(x=0.01)
    _whole_numbers(axes)
    tidy(axes)
    list_lines(axes, axes.lines)
    path = folder / f"{results.slug}-fig4-nmsve.png"
    save_figure(figure, path, overwrite=True, dpi=DPI)
    caption = (
        "NMSVE of every frame, all variants at the settings of the tables. Positions are divided "
        "by the diagonal of the first frame's bounding box. Rates differ: Table I has them."
    )
    if {"pca-qs", "pca-qp"} <= {method_of_result(result) for result in measured}:
        caption += " The wide line of `pca-qs` is drawn under that of `pca-qp`."
    return Picture(path, "Fig. 4", caption, 1)


def draw_bits_per_row(results: PaperResults, folder: Path) -> Picture:
    """Fig. 5: bits of an entry in each row of coefficients, for all variants."""
    groups: dict[str, list[Result]] = {}
    for result in usable(results.variants):
        method = method_of_result(result)
        groups.setdefault(method if method in ROW_AXES else "", []).append(result)
    figure = blank_figure(8, 0.4 + 2.7 * len(groups))
    for number, (name, group) in enumerate(groups.items(), 1):
        axes = figure.add_subplot(len(groups), 1, number)
        lines = [_draw_rows(axes, labels, same) for labels, same in _group_equal_rows(group)]
        title, rows = ROW_AXES[name]
        axes.set_title(title.format(**group[0]["identity"]["setting"]), loc="left", fontsize=10)
        unit = "frame" if name == "gft" else "vertex"  # a frequency has a coefficient per frame
        axes.set(xlabel=rows, ylabel=f"bits per {unit}")
        axes.margins(y=0.08)
        axes.set_ylim(bottom=0)
        _whole_numbers(axes)
        tidy(axes)
        list_lines(axes, lines)
    path = folder / f"{results.slug}-fig5-bits-per-row.png"
    save_figure(figure, path, overwrite=True, dpi=DPI)
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
        draw_envelopes(figure.add_subplot(len(ERRORS), 1, number), results.points(key), name)
    path = folder / f"{results.slug}-rate-distortion.png"
    save_figure(figure, path, overwrite=True, dpi=DPI)
    caption = (
        "Three errors, of evenly spaced frames, over the rate of the whole file, without the order "
        "of vertices and faces. Each point is a stream. A line connects the Pareto-optimal streams "
        "of a method; the others are small points."
    )
    return Picture(path, "Rate and distortion", caption, len(ERRORS))


def _group_equal_rows(group: Sequence[Result]) -> list[tuple[str, Result]]:
    """Results with distinct rows, each with the labels of all results that share them."""
    groups: list[tuple[str, Result]] = []
    for result in group:
        label = label_of_result(result)
        for number, (labels, other) in enumerate(groups):
            if other["bits_per_row"] == result["bits_per_row"]:
                groups[number] = (f"{labels},\n{label}", result)
                break
        else:
            groups.append((label, result))
    return groups


def _draw_rows(axes: "Axes", labels: str, result: Result) -> "Line2D":
    """Draw the rows of all blocks of a variant, and return the line of the last block."""
    style, position = line_style(label_of_result(result)), 0
    for number, rows in enumerate(result["bits_per_row"], 1):
        bits = np.mean(rows, axis=0)
        xs = np.arange(position, position + len(bits)) + 1
        marker = "o" if len(bits) < 60 else None
        [line] = axes.plot(xs, bits, marker=marker, markersize=3, label=labels, **style)
        if number % 2 == 0:
            axes.axvspan(xs[0] - 0.5, xs[-1] + 0.5, color="#000000", alpha=0.06, lw=0)
        position += len(bits)
    axes.set_xlim(0.5, position + 0.5)
    return line


def _whole_numbers(axes: "Axes") -> None:
    """Tick the horizontal axis at whole numbers."""
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
