"""The search over rows and bits as a plot."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshreel.paper.sweeps import BITS, MODES
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.studies.plots import plain_ticks, tidy
from meshreel.studies.runs import Result
from questions.answers import envelope, rows_answer, shown_knee

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KNEE_COLOR = "#D55E00"
PANELS = (("kg_error_percent", "KG error (%)"), ("sted", "STED"))


def draw_rows(figures: Result, path: Path) -> None:
    """Draw errors over the rate of all pairs of rows and bits, with the envelope colored by rows.

    Parameters
    ----------
    figures : dict
        Of `search.rows_run`.
    """
    import matplotlib as mpl

    points, answer = figures["points"], rows_answer(figures)
    rows = sorted({point["modes"] for point in points})
    colors = dict(zip(rows, mpl.colormaps["viridis"](np.linspace(0, 0.92, len(rows))), strict=True))
    figure = blank_figure(8, 7.5)
    axes_of = figure.subplots(len(PANELS), 1, sharex=True)
    for axes, (error, label) in zip(axes_of, PANELS, strict=True):
        _draw_points(axes, [point for point in points if point[error]], error, colors)
        if (knee := shown_knee(answer[error]["knee"])) is not None:
            at = next(
                (rate, value) for rate, value in _pairs(points, error) if rate == knee["rate_bpvf"]
            )
            axes.plot(*at, "o", markersize=17, mfc="none", mec=KNEE_COLOR)
            axes.annotate(
                "knee", at, (-14, 0),
                textcoords="offset points", ha="right", va="center", color=KNEE_COLOR,
            )  # fmt: skip
        axes.set(xscale="log", yscale="log", ylabel=label)
        plain_ticks(axes.xaxis)
        plain_ticks(axes.yaxis)
        tidy(axes)
    axes_of[-1].set_xlabel("bits per vertex and frame, order dropped")
    handles, labels = axes_of[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", frameon=False)
    save_figure(figure, path, overwrite=True, dpi=240)


def _pairs(points: Sequence[dict[str, Any]], error: str) -> list[tuple[float, float]]:
    return [(point["rate_bpvf"], point[error]) for point in points]


def _draw_points(
    axes: "Axes", points: Sequence[dict[str, Any]], error: str, colors: dict[int, Any]
) -> None:
    best = envelope(points, error)

    def draw(some: Sequence[dict[str, Any]], *style: str, **options: Any) -> None:
        axes.plot(*np.array(_pairs(some, error)).reshape(-1, 2).T, *style, **options)

    draw(best, color="#999999", linewidth=1.2)
    for modes, color in colors.items():
        same = [point for point in points if point["modes"] == modes]
        draw([one for one in same if one not in best], ".", color=color, alpha=0.45, markersize=5)
        chosen = [one for one in same if one in best]
        draw(chosen, "o", color=color, markersize=8, zorder=3, label=f"{modes} rows")
    for one, at in zip(best, _pairs(best, error), strict=True):
        axes.annotate(
            str(one["bits"]), at, (6, 4), textcoords="offset points", fontsize=8, color="#444444"
        )
    table = [point for point in points if (point["modes"], point["bits"]) == (MODES, BITS)]
    label = f"tables:\n{MODES} rows, {BITS} bits"
    draw(table, "s", markersize=14, mfc="none", mec="#000000", zorder=4, label=label)
