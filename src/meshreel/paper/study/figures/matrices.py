"""Images of matrices: Fig. 2 (projected deltas) and Fig. 6 (dictionaries of blocks)."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshreel.arrays import Floats
from meshreel.codec.paper_options import DEFAULT_ITERATIONS
from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.model.sequence import MeshSequence
from meshreel.paper.blocks import write_curves, write_rows
from meshreel.paper.choices import PaperChoices
from meshreel.paper.pipeline import CodedBlock, Quantized
from meshreel.paper.quantization import step_for_all_rows
from meshreel.paper.study.claims import (
    NEAR_ZERO,
    bits_per_entry,
    near_zero_percent,
    projected_deltas,
)
from meshreel.paper.study.figures.panels import Box, axes_in, blank_sheet, save_for_print, write_in
from meshreel.paper.subspace.orthogonal_iteration import advance_basis, align_basis, ritz_vectors
from meshreel.rendering.documents import Picture
from meshreel.rendering.plots import blank_figure
from meshreel.runtime.counting import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage


CORNER_ROWS, CORNER_COLUMNS = 30, 300
MAX_SHOWN = 500  # rows and columns of a panel of Fig. 2; larger matrices are averaged
DECADES = 6  # range of the log scale of Fig. 2, below the largest entry
N_SHADES = 9  # samples of the color map of Fig. 2
MAX_BLOCKS = 5
AXIS = 0  # x

# Fig. 6, in pixels of a sheet.
MATRIX_PX, MATRIX_GAP_PX = 270, 24
TOP_PX, LEFT_PX, BETWEEN_PX, BOTTOM_PX = 60, 110, 100, 100
BAR_GAP_PX, BAR_PX, BAR_LABELS_PX = 40, 28, 130


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
    shown = {"all entries": magnitudes}
    if corner.shape != magnitudes.shape:
        n_rows, n_columns = corner.shape
        shown[f"detail: rows 1 to {n_rows}, vertices 1 to {n_columns}"] = corner
    figure = blank_figure(9.6, 6)
    figure.set_layout_engine("constrained", wspace=0.06, hspace=0.06)
    widths = (1.6, 1)[: len(shown)]
    panels = figure.subplots(len(scales), len(shown), width_ratios=widths, squeeze=False)
    for row, (scale, norm) in zip(panels, scales.items(), strict=True):
        for axes, (title, values) in zip(row, shown.items(), strict=True):
            n_rows, n_columns = values.shape
            image = axes.imshow(
                np.maximum(averaged(values, MAX_SHOWN), smallest),
                norm=norm,
                aspect="auto",
                extent=(0.5, n_columns + 0.5, n_rows + 0.5, 0.5),
                interpolation="nearest",
                cmap=colors,
            )
            axes.set_title(f"{title}, {scale} scale", fontsize=10)
            axes.set(xlabel="vertex", ylabel="row (eigen-trajectory)")
            _number_from_1(axes)
        if len(shown) > 1:
            size = corner.shape[1], len(corner)
            row[0].add_patch(Rectangle((0.5, 0.5), *size, fill=False, color="#D55E00", lw=1.2))
        extend = "min" if scale == "log" else "neither"
        figure.colorbar(image, ax=row, label="magnitude (diagonals)", extend=extend, pad=0.02)
    path = folder / f"{slug}-fig2-projected-deltas.png"
    save_for_print(figure, path)
    return Picture(path, "Fig. 2", _deltas_caption(magnitudes, len(shown) > 1), panels.size)


def _deltas_caption(magnitudes: Floats, has_detail: bool) -> str:
    n_rows, n_columns = magnitudes.shape
    detail = ", and its upper left corner, which the rectangle marks" if has_detail else ""
    text = (
        f"Magnitudes of the projected delta matrix of x ({n_rows} x {n_columns}){detail}, on a "
        f"linear scale and on a log scale of {DECADES} decades. "
    )
    height, width = (-(-length // MAX_SHOWN) for length in magnitudes.shape)
    if height * width > 1:
        text += f"A pixel of the whole matrix is the mean of {height} x {width} entries. "
    small, tiny = (near_zero_percent(magnitudes, limit) for limit in NEAR_ZERO)
    energy = (magnitudes**2).sum(axis=1)
    share = 100 * energy[:20].sum() / (energy.sum() or 1.0)
    return (
        f"{text}{small:.1f} % of the entries are at most {100 * NEAR_ZERO[0]:g} % of the largest, "
        f"{tiny:.1f} % at most {100 * NEAR_ZERO[1]:g} %. "
        f"Energy in the first {counted(min(20, n_rows), 'row')}: {share:.3f} %."
    )


def averaged(values: Floats, max_size: int) -> Floats:
    """Average neighboring rows and columns, so that at most `max_size` of each remain."""
    for axis, length in enumerate(values.shape):
        starts = np.arange(0, length, -(-length // max_size))
        sizes = np.diff(starts, append=length)
        sums = np.add.reduceat(values, starts, axis=axis)
        values = sums / (sizes[:, None] if axis == 0 else sizes)
    return values


def whole_dictionaries(sequence: MeshSequence, block_frames: int) -> list[Quantized]:
    """Dictionaries of all blocks of equal length with all columns, tracked as in `blocks`.

    Parameters
    ----------
    block_frames : int
        The paper's k_f, at most the frames of the sequence.

    Returns
    -------
    list of Quantized of shape (3, k_f, k_f), a row for each column of U
    """
    frame = bounding_frame(sequence.extent)
    dictionaries: list[Quantized] = []
    for start in range(0, sequence.n_frames - block_frames + 1, block_frames):
        vertices = sequence.vertices[start : start + block_frames]
        correlation = autocorrelation(to_matrices(vertices, frame))
        if dictionaries:
            previous = np.swapaxes(dictionaries[-1].values, 1, 2)
            tracked = advance_basis(correlation, previous, DEFAULT_ITERATIONS)
            basis = align_basis(ritz_vectors(correlation, tracked), previous)
            steps = dictionaries[-1].steps
        else:
            _, basis = eigen_trajectories(correlation, block_frames)
            steps = step_for_all_rows(basis, PaperChoices().dictionary_bits)
        dictionaries.append(Quantized.of(np.swapaxes(basis, 1, 2), steps))
    return dictionaries


def draw_dictionaries(
    sequence: MeshSequence, blocks: Sequence[CodedBlock], slug: str, folder: Path
) -> Picture:
    """Fig. 6: whole dictionaries of consecutive blocks, and the differences between them.

    Parameters
    ----------
    blocks : sequence of CodedBlock
        From a stream of `blocks`, which contains only the first columns.
    """
    kept = [block.basis for block in blocks if block.basis is not None]
    kept = [basis for basis in kept if basis.integers.shape == kept[0].integers.shape]
    n_kept, block_frames = kept[0].integers.shape[1:]
    whole = whole_dictionaries(sequence, block_frames)
    shown = whole[:MAX_BLOCKS]
    n_blocks = len(shown)
    rows = [[dictionary.values[AXIS].T for dictionary in shown]]
    titles = [[f"U[{number}]" for number in range(1, n_blocks + 1)]]
    if n_blocks > 1:
        rows.append([after - before for before, after in pairwise(rows[0])])
        titles.append(
            [f"U[{number + 1}] \N{MINUS SIGN} U[{number}]" for number in range(1, n_blocks)]
        )
    width = LEFT_PX + n_blocks * (MATRIX_PX + MATRIX_GAP_PX) - MATRIX_GAP_PX
    height = TOP_PX + len(rows) * (MATRIX_PX + BETWEEN_PX) - BETWEEN_PX
    figure = blank_sheet(width + BAR_GAP_PX + BAR_PX + BAR_LABELS_PX, height + BOTTOM_PX)
    largest = max(float(np.abs(values).max()) for values in rows[0]) or 1.0
    for number, (row, names) in enumerate(zip(rows, titles, strict=True)):
        for column, (values, name) in enumerate(zip(row, names, strict=True)):
            # Differences are centered below their two dictionaries.
            left = LEFT_PX + (column + number / 2) * (MATRIX_PX + MATRIX_GAP_PX)
            top = TOP_PX + number * (MATRIX_PX + BETWEEN_PX)
            axes = axes_in(figure, Box(left, top, MATRIX_PX, MATRIX_PX))
            image = _draw_matrix(axes, values, largest, n_kept)
            axes.set_title(name, fontsize=8, pad=4)
            if column == 0:
                axes.set_ylabel("frame of the block", fontsize=7, labelpad=2)
            else:
                axes.set_yticklabels([])
    middle = LEFT_PX + (width - LEFT_PX) / 2
    write_in(figure, "column (eigen-trajectory)", middle, height + 0.7 * BOTTOM_PX, size=7)
    bar = axes_in(figure, Box(width + BAR_GAP_PX, TOP_PX, BAR_PX, height - TOP_PX))
    exceeds = any(np.abs(values).max() > largest for row in rows for values in row)
    figure.colorbar(image, cax=bar, extend="both" if exceeds else "neither")
    bar.set_ylabel("entry", fontsize=7)
    bar.tick_params(labelsize=7)
    path = folder / f"{slug}-fig6-dictionaries.png"
    save_for_print(figure, path)
    caption = _dictionary_caption(kept, whole, n_blocks)
    return Picture(path, "Fig. 6", caption, sum(map(len, rows)))


def _draw_matrix(axes: "Axes", values: Floats, largest: float, n_kept: int) -> "AxesImage":
    """Draw a dictionary or a difference, with a dashed line after the first `n_kept` columns."""
    n_rows, n_columns = values.shape
    extent = (0.5, n_columns + 0.5, n_rows + 0.5, 0.5)
    image = axes.imshow(
        values, vmin=-largest, vmax=largest, extent=extent, interpolation="nearest", cmap="RdBu_r"
    )
    if n_kept < n_columns:
        axes.axvline(n_kept + 0.5, color="#000000", linewidth=0.8, linestyle="--")
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


def _dictionary_caption(kept: Sequence[Quantized], whole: Sequence[Quantized], n_shown: int) -> str:
    n_kept, n_columns = (bases[0].integers.shape[1] for bases in (kept, whole))
    size = f"{n_columns} x {n_columns}"
    line = f"The dashed line follows column {n_kept}: `blocks` keeps {n_kept} columns. "
    if n_kept == n_columns:
        line = ""
    if n_shown == 1:
        return (
            f"The whole dictionary of x ({size}) of the only block of "
            f"{counted(n_columns, 'frame')}. {line}There is no second block to compare it with."
        )
    text = (
        f"Whole dictionaries of x ({size}) of the first {n_shown} blocks, and below them the "
        "differences between consecutive dictionaries, on the same color scale; columns have the "
        f"order and signs closest to those of the block before. {line}Root mean "
        "squares of the entries, and their mean bits coded entry by entry (as curves over time, as "
        f"in streams), over x, y and z of all {len(whole)} blocks of this length but the first: "
    )
    parts = [(f"all {n_columns} columns", whole)]
    if n_kept < n_columns:
        parts.insert(0, (f"the {n_kept} columns in the stream", kept))
    costs = [f"{name}, {_cost_text(bases)}" for name, bases in parts]
    return text + "; ".join(costs) + "."


def _cost_text(dictionaries: Sequence[Quantized]) -> str:
    """Sizes and bits of the entries of all dictionaries but the first, and of the differences."""
    values = np.array([dictionary.values for dictionary in dictionaries])
    rms, difference_rms = (
        np.sqrt(np.mean(part**2)) for part in (values[1:], np.diff(values, axis=0))
    )
    plain, curves = (bits_per_entry(dictionaries, write) for write in (write_rows, write_curves))
    assert plain is not None  # at least two dictionaries, of equal shape
    assert curves is not None
    return (
        f"differences {difference_rms:.3f} and {plain[1]:.2f} ({curves[1]:.2f}) bits, "
        f"dictionaries {rms:.3f} and {plain[0]:.2f} ({curves[0]:.2f}) bits"
    )
