"""Plots of figures over frames; they need the extra [plot]."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from meshreel.atomic_write import replace_when_done
from meshreel.errors import InvalidInputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's palette, which colour-blind readers can tell apart.
LINE_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


def plot_error_per_frame(
    path: Path,
    nmsve: Mapping[str, npt.NDArray[np.float64]],
    *,
    fps: float = 0.0,
    overwrite: bool = False,
) -> None:
    """Write a PNG with the NMSVE of every frame, a line for each decoded sequence.

    Parameters
    ----------
    path : Path
    nmsve : mapping of label to float64 array of shape (T,)
    fps : float, default 0
        Frames per second; adds a second axis in seconds unless it is 0.

    Raises
    ------
    InvalidInputError
        If matplotlib is not installed, or the path cannot be written.
    """
    figure = blank_figure(8, 4.5)
    axes = figure.add_subplot()
    for color, (label, errors) in zip(LINE_COLORS, nmsve.items(), strict=False):
        marker = "o" if len(errors) == 1 else None
        axes.plot(np.arange(len(errors)), errors, color=color, label=label, marker=marker)
    axes.set(xlabel="frame", ylabel="NMSVE (positions in diagonals)")
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    if fps > 0:
        frame_to_seconds = (lambda frame: np.asarray(frame) / fps, lambda second: second * fps)
        seconds = axes.secondary_xaxis("top", functions=frame_to_seconds)
        seconds.set_xlabel("seconds")
    save_figure(figure, path, overwrite=overwrite)


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
