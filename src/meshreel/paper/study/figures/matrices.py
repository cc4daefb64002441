"""Images of matrices: Fig. 2 (projected deltas) and Fig. 6 (dictionaries of blocks)."""

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshreel.arrays import Floats
from meshreel.model.sequence import MeshSequence
from meshreel.paper.study.figures.diagrams import DPI
from meshreel.paper.study.runs import NEAR_ZERO, dictionaries, near_zero_percent, projected_deltas
from meshreel.rendering.documents import Picture
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.runtime.counting import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage


CORNER_ROWS, CORNER_COLUMNS = 30, 300
DECADES = 6  # range of the log scale of Fig. 2, below the largest entry
N_SHADES = 9  # samples of the color map of Fig. 2
MAX_BLOCKS = 5
AXIS = 0  # x


def draw_projected_deltas(sequence: MeshSequence, slug: str, folder: Path) -> Picture:
    """Fig. 2: the matrix and a detail of its first rows and vertices, on two color scales."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
    from matplotlib.patches import Rectangle

    magnitudes = projected_deltas(sequence)
    largest = float(magnitudes.max()) or 1.0
    smallest = largest * 10.0**-DECADES
    scales = {"linear": Normalize(0.0, largest), "log": LogNorm(smallest, largest)}
    shades = ["#FFFFFF", *colormaps["viridis_r"](np.linspace(0.0, 1.0, N_SHADES))]
    colors = LinearSegmentedColormap.from_list("viridis from white", shades)
    corner = magnitudes[:CORNER_ROWS, :CORNER_COLUMNS]
    views = {"all entries": magnitudes}
    if corner.shape != magnitudes.shape:
        n_rows, n_columns = corner.shape
        views[f"detail: rows 1 to {n_rows}, vertices 1 to {n_columns}"] = corner
    figure = blank_figure(9.6, 6)
    figure.set_layout_engine("constrained", wspace=0.06, hspace=0.06)
    widths = (1.6, 1)[: len(views)]
    panels = figure.subplots(len(scales), len(views), width_ratios=widths, squeeze=False)
    for row, (scale, norm) in zip(panels, scales.items(), strict=True):
        for axes, (title, values) in zip(row, views.items(), strict=True):
            n_rows, n_columns = values.shape
            image = axes.imshow(
                np.maximum(values, smallest),
                norm=norm,
                aspect="auto",
                extent=(0.5, n_columns + 0.5, n_rows + 0.5, 0.5),
                interpolation="nearest" if values is corner else "antialiased",
                cmap=colors,
            )
            axes.set_title(f"{title}, {scale} scale", fontsize=10)
            axes.set(xlabel="vertex", ylabel="row (eigen-trajectory)")
            _number_from_1(axes)
        if len(views) > 1:
            size = corner.shape[1], len(corner)
            row[0].add_patch(Rectangle((0.5, 0.5), *size, fill=False, color="#D55E00", lw=1.2))
        extend = "min" if scale == "log" else "neither"
        figure.colorbar(image, ax=row, label="magnitude (diagonals)", extend=extend, pad=0.02)
    path = folder / f"{slug}-fig2-projected-deltas.png"
    save_figure(figure, path, overwrite=True, dpi=DPI)
    n_rows, n_columns = magnitudes.shape
    detail = ", and its upper left corner, which the rectangle marks" if len(views) > 1 else ""
    small, tiny = (near_zero_percent(magnitudes, limit) for limit in NEAR_ZERO)
    energy = (magnitudes**2).sum(axis=1)
    share = 100 * energy[:20].sum() / (energy.sum() or 1.0)
    caption = (
        f"Magnitudes of the projected delta matrix of x ({n_rows} x {n_columns}){detail}, on a "
        f"linear scale and on a log scale of {DECADES} decades. "
        f"{small:.1f} % of the entries are at most {100 * NEAR_ZERO[0]:g} % of the largest, "
        f"{tiny:.1f} % at most {100 * NEAR_ZERO[1]:g} %. "
        f"Energy in the first {counted(min(20, n_rows), 'row')}: {share:.3f} %."
    )
    return Picture(path, "Fig. 2", caption, panels.size)


def draw_dictionaries(
    sequence: MeshSequence, block_frames: int, n_stored: int, slug: str, folder: Path
) -> Picture:
    """Fig. 6: whole dictionaries of consecutive blocks, and the differences between them.

    Parameters
    ----------
    block_frames : int
        Frames of each block.
    n_stored : int
        Columns that streams of `blocks` contain.
    """
    bases = dictionaries(sequence, block_frames, block_frames)[:MAX_BLOCKS]
    n_blocks = len(bases)
    rows = [[basis.values[AXIS].T for basis in bases]]
    titles = [[f"U[{number}]" for number in range(1, n_blocks + 1)]]
    if n_blocks > 1:
        rows.append([after - before for before, after in pairwise(rows[0])])
        titles.append(
            [f"U[{number + 1}] \N{MINUS SIGN} U[{number}]" for number in range(1, n_blocks)]
        )
    figure = blank_figure(1.3 * n_blocks + 1, 1.6 * len(rows) + 0.4)
    # A dictionary covers two columns, so that differences are centered below their dictionaries.
    grid = figure.add_gridspec(len(rows), 2 * n_blocks)
    largest = max(float(np.abs(values).max()) for values in rows[0]) or 1.0
    for number, (row, names) in enumerate(zip(rows, titles, strict=True)):
        for column, (values, name) in enumerate(zip(row, names, strict=True)):
            left = 2 * column + number
            axes = figure.add_subplot(grid[number, left : left + 2])
            image = _draw_matrix(axes, values, largest, n_stored)
            axes.set_title(name, fontsize=8, pad=4)
            if column == 0:
                axes.set_ylabel("frame of the block", fontsize=7, labelpad=2)
            else:
                axes.set_yticklabels([])
    figure.supxlabel("column (eigen-trajectory)", fontsize=7)
    exceeds = any(np.abs(values).max() > largest for row in rows for values in row)
    bar = figure.colorbar(image, ax=figure.axes, extend="both" if exceeds else "neither")
    bar.set_label("entry", fontsize=7)
    bar.ax.tick_params(labelsize=7)
    path = folder / f"{slug}-fig6-dictionaries.png"
    save_figure(figure, path, overwrite=True, dpi=DPI)
    line = f"The dashed line follows column {n_stored}: `blocks` keeps {n_stored} columns. "
    caption = (
        f"Whole dictionaries of x ({block_frames} x {block_frames}) of the first "
        f"{counted(n_blocks, 'block')}"
    )
    if n_blocks > 1:
        caption += (
            ", and below them the differences between consecutive dictionaries, on the same color "
            "scale; columns have the order and signs closest to those of the block before"
        )
    caption += f". {line if n_stored < block_frames else ''}Findings list the bits of an entry."
    return Picture(path, "Fig. 6", caption, sum(map(len, rows)))


def _draw_matrix(axes: "Axes", values: Floats, largest: float, n_stored: int) -> "AxesImage":
    """Draw a dictionary or a difference, with a dashed line after the first `n_stored` columns."""
    n_rows, n_columns = values.shape
    extent = (0.5, n_columns + 0.5, n_rows + 0.5, 0.5)
    image = axes.imshow(
        values, vmin=-largest, vmax=largest, extent=extent, interpolation="nearest", cmap="RdBu_r"
    )
    if n_stored < n_columns:
        axes.axvline(n_stored + 0.5, color="#000000", linewidth=0.8, linestyle="--")
    _number_from_1(axes)
    axes.tick_params(labelsize=7, length=2, pad=2)
    return image


def _number_from_1(axes: "Axes") -> None:
    """Tick the first row and column, and round numbers after them."""
    from matplotlib.ticker import MaxNLocator

    for axis in (axes.xaxis, axes.yaxis):
        low, high = sorted(axis.get_view_interval())
        ticks = MaxNLocator(6, integer=True).tick_values(low, high)
        step = ticks[1] - ticks[0]
        axis.set_ticks(
            [1, *(tick for tick in ticks if 1 + 0.5 * step < tick < high and tick % 1 == 0)]
        )
