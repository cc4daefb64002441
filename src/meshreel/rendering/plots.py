"""Plots over frames with matplotlib, the extra [plot]."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.metrics.compare import require_comparable
from meshreel.model.sequence import FrameSource
from meshreel.model.tracks import track_by_name
from meshreel.rendering.track_colors import TrackColors, TrackLook
from meshreel.runtime.extras import PLOT
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.progress import Count, Progress, silent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
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
    """Write a PNG plot of one or more curves over frames.

    Parameters
    ----------
    label : str
        Quantity and unit, for the vertical axis.
    frames : sequence of int
        Numbers of the T frames.
    lines : mapping of str to float64 array of shape (T,)
        Curves by name; NaN leaves a gap. Several curves get a legend.
    fps, start_s : float, default 0
        Frame rate and time of frame 0, for a second axis in seconds unless fps is 0.

    Raises
    ------
    InvalidInputError
        If matplotlib is not installed, or the path cannot be written.
    """
    figure = blank_figure(8, 4.5)
    axes = figure.add_subplot()
    # The upper curve is narrower, so that both are visible where they coincide.
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
    """Add title, grid and the axis in seconds; remove the top and right borders."""
    axes.set_title(title, loc="left", fontsize="medium")
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    if fps > 0:
        conversions = (
            lambda n: start_s + np.divide(n, fps),
            lambda s: np.multiply(np.subtract(s, start_s), fps),
        )
        seconds = axes.secondary_xaxis(-0.16, functions=conversions)
        seconds.set_xlabel("seconds")


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


def save_figure(figure: "Figure", path: Path, *, overwrite: bool = False) -> None:
    """Write a figure as a PNG file, atomically.

    Raises
    ------
    InvalidInputError
        If the path cannot or must not be written.
    """
    with replace_when_done(path, overwrite=overwrite) as temporary:
        figure.savefig(temporary, format="png")


def plot_track(
    path: Path,
    look: TrackLook,
    item: int,
    sequence: FrameSource,
    original: FrameSource | None = None,
    frames: Sequence[int] | None = None,
    *,
    overwrite: bool = False,
    progress: Progress = silent,
) -> None:
    """Write a PNG plot of a track at one item over time.

    Parameters
    ----------
    look : TrackLook
        Its component is plotted; its range is ignored.
    item : int
        Number of the vertex, face or corner, depending on the domain of the track.
    original : FrameSource, optional
        Adds a second curve; must have the same mesh and frames.
    frames : sequence of int, optional
        Frame numbers, ascending. Default: all.

    Raises
    ------
    InvalidInputError
        If the track, component or item does not exist, a color track has no component selected,
        the original has another mesh, matplotlib is missing or the path cannot be written.
    """
    colors = TrackColors(look, track_by_name(sequence.tracks, look.name))
    if colors.shows_colors:
        raise InvalidInputError(
            f"track {look.name!r} contains colors; select a channel to plot, as in --component 0"
        )
    n_items = sequence.tracks[look.name].shape[1]
    if not 0 <= item < n_items:
        raise InvalidInputError(
            f"track {look.name!r} has values of {colors.domain} 0 to {n_items - 1}; got {item}"
        )
    sources = {"decoded": sequence}
    if original is not None:
        require_comparable(original, sequence)
        sources = {"original": original, "decoded": sequence}
    tracks = {name: track_by_name(source.tracks, look.name) for name, source in sources.items()}
    numbers = range(sequence.n_frames) if frames is None else frames
    lines = {name: np.empty(len(numbers)) for name in tracks}
    for step, number in enumerate(numbers):
        for name, track in tracks.items():
            values = track.read(number, number + 1)[0, item : item + 1]
            lines[name][step] = colors.numbers(values)[0]
        progress("reading", Count(step + 1, len(numbers), "frames"))
    unit = f", {colors.unit}" if colors.unit else ""
    title = f"{colors.title} at {colors.domain} {item}"
    plot_over_time(
        path, f"{title} of {sequence.name}" if sequence.name else title, f"{colors.title}{unit}",
        numbers, lines, fps=sequence.fps, start_s=sequence.start_s, overwrite=overwrite,
    )  # fmt: skip
