"""Images of matrices: Fig. 2 (projected deltas) and Fig. 6 (dictionaries of blocks)."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.documents.parts import Picture
from meshreel.geometry.laplacian import delta_coordinates, uniform_laplacian
from meshreel.paper.pipeline import CodedBlock
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.sequence import MeshSequence
from meshreel.subspace.basis import project
from meshreel.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.subspace.trajectories import bounding_frame, to_matrices

Floats = npt.NDArray[np.float64]

CORNER_ROWS, CORNER_COLUMNS = 30, 300
DECADES = 6  # of the colour scale of Fig. 2, down from the largest entry
MOST_BLOCKS = 5
AXIS = 0  # x


def projected_deltas(sequence: MeshSequence) -> Floats:
    """Magnitudes of U^T delta^T of the x coordinate, shape (T, V), in diagonals."""
    frame = bounding_frame(sequence.extent)
    matrix = to_matrices(sequence.vertices, frame)[AXIS]
    _, basis = eigen_trajectories(autocorrelation(matrix), sequence.n_frames)
    laplacian = uniform_laplacian(sequence.faces, sequence.n_verts, normalized=True)
    return np.abs(delta_coordinates(laplacian, project(basis, matrix).T).T)


def draw_projected_deltas(sequence: MeshSequence, slug: str, folder: Path) -> Picture:
    """Fig. 2: the whole matrix, and its corner of the first rows and vertices."""
    from matplotlib.colors import LogNorm

    magnitudes = projected_deltas(sequence)
    largest = float(magnitudes.max()) or 1.0
    smallest = largest * 10.0**-DECADES
    norm = LogNorm(smallest, largest)
    corner = magnitudes[:CORNER_ROWS, :CORNER_COLUMNS]
    figure = blank_figure(11, 4.2)
    panels = figure.subplots(1, 2, width_ratios=(1.6, 1))
    for axes, values in zip(panels, (magnitudes, corner), strict=True):
        n_rows, n_columns = values.shape
        extent = (0.5, n_columns + 0.5, n_rows + 0.5, 0.5)
        shown = np.maximum(values, smallest)
        image = axes.imshow(
            shown, norm=norm, aspect="auto", extent=extent, interpolation="nearest", cmap="viridis"
        )
        axes.set(xlabel="vertex", ylabel="row (eigen-trajectory)")
    panels[0].set_title("all rows", fontsize=10)
    panels[1].set_title(f"first {len(corner)} rows, {corner.shape[1]} vertices", fontsize=10)
    figure.colorbar(image, ax=panels, label="magnitude (diagonals)", extend="min")
    path = folder / f"{slug}-fig2-projected-deltas.png"
    save_figure(figure, path, overwrite=True)
    energy = (magnitudes**2).sum(axis=1)
    share = 100 * energy[:20].sum() / (energy.sum() or 1.0)
    caption = (
        f"Magnitudes of the projected delta matrix of x ({sequence.n_frames} x "
        f"{sequence.n_verts}) on a log scale of {DECADES} decades, and its upper left corner. "
        f"The first {min(20, len(energy))} rows hold {share:.3f} % of its energy."
    )
    return Picture(path, "Fig. 2", caption, len(panels))


def draw_dictionaries(blocks: list[CodedBlock], slug: str, folder: Path) -> Picture:
    """Fig. 6: dictionaries of consecutive blocks as decoded, and their differences below."""
    bases = [
        np.swapaxes(block.basis.values[AXIS], 0, 1)
        for block in blocks[:MOST_BLOCKS]
        if block.basis is not None
    ]
    largest = max(float(np.abs(basis).max()) for basis in bases) or 1.0
    differences = [
        after - before if after.shape == before.shape else None for before, after in pairwise(bases)
    ]
    figure = blank_figure(2.3 * len(bases) + 1.2, 5.4 if differences else 3.2)
    panels = figure.subplots(2 if differences else 1, len(bases), squeeze=False)
    n_panels = 0
    for row in panels:
        for axes in row:
            axes.set_visible(False)
    titles = [f"U[{number}]" for number in range(1, len(bases) + 1)]
    cells = list(zip(panels[0], bases, titles, strict=True))
    for number, difference in enumerate(differences, 1):
        if difference is not None:
            cells.append((panels[1][number], difference, f"U[{number + 1}] - U[{number}]"))
    for axes, values, title in cells:
        axes.set_visible(True)
        extent = (0.5, values.shape[1] + 0.5, values.shape[0] + 0.5, 0.5)
        image = axes.imshow(
            values, vmin=-largest, vmax=largest, extent=extent, interpolation="nearest",
            cmap="RdBu_r", aspect="auto",
        )  # fmt: skip
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("mode")
        n_panels += 1
    for axes in (panels[0][0], panels[-1][min(1, len(bases) - 1)]):
        axes.set_ylabel("frame of the block")
    figure.colorbar(image, ax=panels, label="entry (orthonormal columns)", shrink=0.8)
    path = folder / f"{slug}-fig6-dictionaries.png"
    save_figure(figure, path, overwrite=True)
    caption = (
        f"Dictionaries of x of the first {len(bases)} of {len(blocks)} blocks as the decoder has "
        f"them, and below their differences, on the same colour scale (+-{largest:.2f}). "
        f"{_difference_text(bases, differences)}"
    )
    return Picture(path, "Fig. 6", caption, n_panels)


def _difference_text(bases: list[Floats], differences: list[Floats | None]) -> str:
    found = [difference for difference in differences if difference is not None]
    if not found:
        return "There are no two blocks of equal length to compare."
    size = np.sqrt(np.mean([np.mean(difference**2) for difference in found]))
    whole = np.sqrt(np.mean([np.mean(basis**2) for basis in bases]))
    return f"The entries of a difference are {size / whole:.2f} times those of a dictionary (RMS)."
