"""Figures of matplotlib, the extra [plot]."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshreel.runtime.extras import PLOT
from meshreel.runtime.outputs.atomic import replace_when_done

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
