"""Plots over frames with matplotlib, the extra [plot]."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshreel.runtime.extras import PLOT
from meshreel.runtime.outputs.atomic import replace_when_done

if TYPE_CHECKING:
    from matplotlib.figure import Figure


LINE_COLOR = "#4B0092"
"""The color of `reel` in the figures of `meshreel evaluate`."""

MIN_LOG_RATIO = 30.0
"""Errors are drawn on a log axis if the largest exceeds the smallest by this factor."""


def plot_error_per_frame(
    path: Path,
    title: str,
    errors: npt.NDArray[np.float64],
    *,
    label: str = "NMSVE (positions in diagonals)",
    fps: float = 0.0,
    overwrite: bool = False,
) -> None:
    """Write a PNG plot of the error of every frame and its mean.

    Parameters
    ----------
    errors : float64 array of shape (T,)
    label : str, optional
        Name and unit of the errors. Default: those of the NMSVE.
    fps : float, default 0
        Frames per second; adds a second axis in seconds unless it is 0.

    Raises
    ------
    InvalidInputError
        If matplotlib is not installed, or the path cannot be written.
    """
    figure = blank_figure(8, 4.5)
    axes = figure.add_subplot()
    axes.plot(
        np.arange(len(errors)), errors, color=LINE_COLOR, marker="o" if len(errors) == 1 else None
    )
    lowest, mean, highest = float(errors.min()), float(errors.mean()), float(errors.max())
    if np.isfinite(mean):
        axes.axhline(mean, color=LINE_COLOR, linewidth=0.8, linestyle="--")
        axes.annotate(
            f"mean\n{mean:.2e}", (1.01, mean),
            xycoords=axes.get_yaxis_transform(), va="center", color=LINE_COLOR,
            annotation_clip=False,
        )  # fmt: skip
    axes.set(xlabel="frame", ylabel=label)
    if 0 < MIN_LOG_RATIO * lowest < highest < np.inf:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0)
        axes.yaxis.set_major_formatter("{x:g}")
    axes.set_title(title, loc="left", fontsize="medium")
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    if fps > 0:
        functions = (lambda n: np.divide(n, fps), lambda s: np.multiply(s, fps))
        seconds = axes.secondary_xaxis(-0.16, functions=functions)
        seconds.set_xlabel("seconds")
    save_figure(figure, path, overwrite=overwrite)


def require_matplotlib() -> Any:
    """Return matplotlib's Figure class; call it before long work to fail early.

    Raises
    ------
    InvalidInputError
        If matplotlib is not installed.
    """
    return PLOT.load("figure").Figure


def blank_figure(width_in: float, height_in: float) -> "Figure":
    """An empty figure that needs no display.

    Raises
    ------
    InvalidInputError
        If matplotlib is not installed.
    """
    figure: Figure = require_matplotlib()(
        figsize=(width_in, height_in), dpi=120, layout="constrained"
    )
    return figure


def save_figure(
    figure: "Figure", path: Path, *, overwrite: bool = False, dpi: float | None = None
) -> None:
    """Write a figure as a PNG file, atomically, at its own resolution or another.

    Raises
    ------
    InvalidInputError
        If the path cannot or must not be written.
    """
    with replace_when_done(path, overwrite=overwrite) as temporary:
        figure.savefig(temporary, format="png", dpi=dpi or figure.dpi)
