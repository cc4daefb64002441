"""Plots of figures over frames; they need the extra [plot]."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.runtime.outputs.atomic import replace_when_done

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE_COLOR = "#4B0092"
"""That of `reel` in the figures of `meshreel evaluate`."""

LOG_FROM_RATIO = 30.0
"""Errors whose largest is this many times the smallest are drawn on a log axis."""


def plot_error_per_frame(
    path: Path,
    title: str,
    nmsve: npt.NDArray[np.float64],
    *,
    fps: float = 0.0,
    overwrite: bool = False,
) -> None:
    """Write a PNG with the NMSVE of every frame, and a line at their mean.

    Parameters
    ----------
    title : str
        Names what is compared.
    nmsve : float64 array of shape (T,)
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
        np.arange(len(nmsve)), nmsve, color=LINE_COLOR, marker="o" if len(nmsve) == 1 else None
    )
    lowest, mean, highest = (float(of(nmsve)) for of in (np.min, np.mean, np.max))
    if np.isfinite(mean):
        axes.axhline(mean, color=LINE_COLOR, linewidth=0.8, linestyle="--")
        axes.annotate(
            f"mean\n{mean:.2e}", (1.01, mean),
            xycoords=axes.get_yaxis_transform(), va="center", color=LINE_COLOR,
            annotation_clip=False,
        )  # fmt: skip
    axes.set(xlabel="frame", ylabel="NMSVE (positions in diagonals)")
    if 0 < LOG_FROM_RATIO * lowest < highest < np.inf:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0)
        axes.yaxis.set_major_formatter("{x:g}")
    _finish(axes, title, fps)
    save_figure(figure, path, overwrite=overwrite)


def plot_over_time(
    path: Path,
    title: str,
    label: str,
    frames: Sequence[int],
    lines: Mapping[str, npt.NDArray[np.float64]],
    *,
    fps: float = 0.0,
    start_s: float = 0.0,
    overwrite: bool = False,
) -> None:
    """Write a PNG with numbers of each frame, a line for each name.

    Parameters
    ----------
    title : str
        Says where the numbers are from.
    label : str
        What they are, with their unit.
    frames : sequence of int
        Numbers of the T frames.
    lines : mapping of str to float64 array of shape (T,)
        By name, which is written beside where there are several; NaN leaves a gap.
    fps, start_s : float, default 0
        Frames per second and time of frame 0; add a second axis in seconds unless fps is 0.

    Raises
    ------
    InvalidInputError
        If matplotlib is not installed, or the path cannot be written.
    """
    figure = blank_figure(8, 4.5)
    axes = figure.add_subplot()
    # The last lies on top, and is narrower, so that both are seen where they coincide.
    styles = (("#8C8C8C", 4.0), (LINE_COLOR, 1.5))[-len(lines) :]
    for (name, numbers), (color, width) in zip(lines.items(), styles, strict=True):
        marker = "o" if len(frames) == 1 else None
        axes.plot(frames, numbers, color=color, linewidth=width, marker=marker, label=name)
    axes.set(xlabel="frame", ylabel=label)
    axes.ticklabel_format(axis="y", useOffset=False)
    if len(lines) > 1:
        axes.legend(frameon=False)
    _finish(axes, title, fps, start_s)
    save_figure(figure, path, overwrite=overwrite)


def _finish(axes: "Axes", title: str, fps: float, start_s: float = 0.0) -> None:
    """Title and grid, no frame at the top and the right, and seconds below frames."""
    axes.set_title(title, loc="left", fontsize="medium")
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    if fps > 0:
        there_and_back = (
            lambda n: start_s + np.divide(n, fps),
            lambda s: np.multiply(np.subtract(s, start_s), fps),
        )
        seconds = axes.secondary_xaxis(-0.16, functions=there_and_back)
        seconds.set_xlabel("seconds")


def require_matplotlib() -> Any:
    """The class of matplotlib's figures; asked for before long work, it fails early.

    Raises
    ------
    InvalidInputError
        If matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InvalidInputError(
            "drawing plots needs matplotlib: pip install 'meshreel[plot]'"
        ) from error
    return Figure


def blank_figure(width_in: float, height_in: float) -> "Figure":
    """An empty figure of this size in inches, drawn without a screen.

    Raises
    ------
    InvalidInputError
        If matplotlib is not installed.
    """
    figure: Figure = require_matplotlib()(
        figsize=(width_in, height_in), dpi=120, layout="constrained"
    )
    return figure


def save_figure(figure: "Figure", path: Path, *, overwrite: bool = False) -> None:
    """Write a figure as a PNG file, whole or not at all.

    Raises
    ------
    InvalidInputError
        If the path cannot or must not be written.
    """
    with replace_when_done(path, overwrite=overwrite) as temporary:
        figure.savefig(temporary, format="png")
