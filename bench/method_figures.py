"""Figures of docs/method.md, from the flag of `meshreel demo` and the tables of docs/codec.md.

    python bench/method_figures.py

Writes docs/images/method-hierarchy.png, -stencil, -modes, -prediction and -ablation. Takes half a
minute; needs Matplotlib.
"""

import argparse
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.collections import LineCollection
from matplotlib.colors import CenteredNorm

import meshreel
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.subspace.pca import joint_trajectories
from meshreel.kernel.mesh import Hierarchy
from meshreel.kernel.predict import Choice, encode_values
from meshreel.model.geometry.connectivity import undirected_edges

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

ROOT = Path(__file__).parents[1]
STENCIL_SIZE = 16
N_MODES = 24
N_KNOWN = 10
"""Decoded fields to which the weights of the figures are adapted."""

PREDICTED = 12
"""Index of the mode whose prediction is shown."""

QUALITY_60_STEP = 1e-4 * 2 ** (20 / 12)
"""Quantization step of a position at quality 60, in diagonals of the bounding box."""

CROP_M = 0.42
STENCIL_CROP_M = 0.175
"""Sides of the enlarged parts of the flag, with the hierarchy and with a stencil."""

COARSER_COLOR = "#222222"
LEVEL_COLORS = ("#D55E00", "#0072B2", "#56B4E9")
SEQUENCE_STYLES = (
    ("o", "#D55E00"),
    ("s", "#0072B2"),
    ("D", "#009E73"),
    ("^", "#4B0092"),
    ("v", "#B8860B"),
    ("P", "#222222"),
)
"""Marker and color of each sequence of the ablations."""

SIGNED = "RdBu_r"


@dataclass
class Flag:
    """The flag with its fields and its hierarchy.

    Attributes
    ----------
    flat : float64 array of shape (V, 2)
        Vertices at rest.
    faces : int array of shape (M, 3)
    vectors : float64 array of shape (3 T, K)
        Temporal basis.
    fields : float64 array of shape (V, K)
        In quantization steps of quality 60.
    resolutions : list of lists of int arrays
        Levels of each resolution, coarsest first: the vertices that it adds.
    mesh : FieldMesh
    """

    flat: Floats
    faces: npt.NDArray[np.int32]
    vectors: Floats
    fields: Floats
    resolutions: list[list[Integers]]
    mesh: FieldMesh


def analyzed_flag(n_frames: int) -> Flag:
    """Simulate and analyze the flag like the encoder."""
    sequence = meshreel.simulate_flag(n_frames)
    low, high = sequence.extent.low, sequence.extent.high
    positions = (sequence.vertices - (low + high) / 2) / sequence.extent.mean_diagonal
    matrices = np.ascontiguousarray(positions.astype(np.float64).transpose(2, 0, 1))
    _, vectors = joint_trajectories(matrices, N_MODES)
    step = QUALITY_60_STEP * np.sqrt(n_frames)
    fields = matrices.reshape(-1, sequence.n_verts).T @ vectors / step
    mesh = FieldMesh(sequence.faces, sequence.n_verts, STENCIL_SIZE)
    flat = sequence.vertices[0, :, :2].astype(np.float64)
    return Flag(flat, sequence.faces, vectors, fields, resolutions_of(mesh.hierarchy), mesh)


def resolutions_of(mesh: Hierarchy) -> list[list[Integers]]:
    """Levels of each resolution, coarsest first."""
    levels = np.split(mesh.order.astype(np.int64), mesh.level_starts[1:-1])
    first_levels = np.flatnonzero(np.diff(mesh.level_resolutions)) + 1
    ends = [0, *first_levels.tolist(), len(levels)]
    return [levels[start:stop] for start, stop in pairwise(ends)]


def predictions(flag: Flag, fields: Floats, n_learned: int) -> Floats:
    """Predictions of weights adapted to the first fields, of shape (V, K)."""
    mesh, order = flag.mesh.hierarchy, flag.mesh.order
    plain = Choice(first_shaped=len(mesh.level_starts), gain=0.0, rate_weight=0.0)
    residuals, values = encode_values(mesh, fields[order], plain, n_learned)
    predicted = np.empty_like(fields)
    predicted[order] = values - residuals.T
    return predicted


def weights_of(flag: Flag, row: int, n_learned: int) -> Floats:
    """Weights of a stencil: predictions from fields that are 1 at one of its vertices."""
    size = 1e6  # large enough that rounding is negligible
    peaks = np.zeros((flag.mesh.n_verts, STENCIL_SIZE))
    peaks[flag.mesh.order[flag.mesh.hierarchy.stencil[row]], np.arange(STENCIL_SIZE)] = size
    known = np.hstack([flag.fields[:, :n_learned], peaks])
    target = flag.mesh.order[row]
    return predictions(flag, known, n_learned)[target, n_learned:] / size


def draw_hierarchy(flag: Flag) -> Any:
    """Four resolutions of a corner of the flag, with their levels."""
    figure, panels = plt.subplots(1, 4, figsize=(13, 3.9), layout="constrained")
    edges = undirected_edges(flag.faces)
    for number, panel in enumerate(panels):
        *coarser, levels = flag.resolutions[: len(flag.resolutions) - number]
        kept = np.sort(np.concatenate([level for added in coarser for level in added]))
        draw_edges(panel, flag.flat, edges)
        edges = coarser_edges(edges, kept, flag.mesh.n_verts)
        dots(panel, flag.flat[kept], COARSER_COLOR, "on the coarser resolution")
        for level, (color, vertices) in enumerate(zip(LEVEL_COLORS, levels, strict=False), 1):
            dots(panel, flag.flat[vertices], color, f"level {level}")
        name = "the mesh" if number == 0 else f"coarser resolution {number}"
        n_verts = len(kept) + sum(map(len, levels))
        panel.set_title(f"{name}: {n_verts} vertices", fontsize=10)
        crop(panel, flag, CROP_M * (1 + (number > 1)))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def draw_stencil(flag: Flag) -> Any:
    """A vertex of the finest resolution, its stencil, and two sets of predictor weights."""
    mesh, order = flag.mesh.hierarchy, flag.mesh.order
    corner = flag.flat.min(axis=0) + CROP_M / 2
    finest = np.arange(mesh.level_starts[-2], mesh.n_verts)
    finest = finest[(mesh.stencil[finest] >= 0).all(axis=1)]
    row = int(finest[np.argmin(np.linalg.norm(flag.flat[order[finest]] - corner, axis=1))])
    target, around = order[row], order[mesh.stencil[row]]
    low, high = flag.flat[around].min(axis=0), flag.flat[around].max(axis=0)
    figure, panels = plt.subplots(1, 2, figsize=(9.5, 4.9), layout="constrained")
    titles = ("first weights, from connectivity", f"after {N_KNOWN} decoded fields")
    for panel, title, weights in zip(
        panels, titles, (weights_of(flag, row, 0), weights_of(flag, row, N_KNOWN)), strict=True
    ):
        draw_edges(panel, flag.flat, undirected_edges(flag.faces))
        drawn = panel.scatter(
            *flag.flat[around].T, s=620, c=weights, cmap=SIGNED, norm=CenteredNorm(halfrange=0.6),
            edgecolors="#555555", zorder=3, label="vertex of the stencil, with its weight",
        )  # fmt: skip
        for place, weight in zip(flag.flat[around], weights.round(2) + 0.0, strict=True):
            panel.text(*place, f"{weight:.2f}", ha="center", va="center", fontsize=8.5, zorder=4)
        panel.scatter(
            *flag.flat[target], s=260, marker="s", c=COARSER_COLOR, zorder=3,
            label="predicted vertex",
        )  # fmt: skip
        panel.set_title(title, fontsize=11)
        crop(panel, flag, STENCIL_CROP_M, (low + high) / 2)
    figure.colorbar(drawn, ax=panels, label="weight", shrink=0.8)
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside lower center", ncols=2, frameon=False, markerscale=0.5,
    )  # fmt: skip
    return figure


def draw_modes(flag: Flag) -> Any:
    """Fields on the flag at rest, with the basis vectors of their modes below."""
    chosen = (0, 1, 2, 4, 12)
    figure, panels = plt.subplots(
        2, len(chosen), figsize=(13, 4.2), height_ratios=(3, 2), layout="constrained", sharey="row"
    )
    n_frames = len(flag.vectors) // 3
    for field_panel, time_panel, mode in zip(*panels, chosen, strict=True):
        field = flag.fields[:, mode]
        drawn = draw_field(field_panel, flag, field / np.abs(field).max(), 1.0)
        field_panel.set_title(f"mode {mode + 1}", fontsize=12)
        for axis, color in zip("xyz", ("#D55E00", "#009E73", "#0072B2"), strict=True):
            values = flag.vectors.reshape(3, n_frames, -1)["xyz".index(axis), :, mode]
            time_panel.plot(values, color=color, lw=1.1, label=axis)
        time_panel.set_xlabel("frame", fontsize=10)
        time_panel.tick_params(labelsize=9)
        time_panel.spines[["top", "right"]].set_visible(False)
    panels[0][0].set_ylabel("field", fontsize=11)
    panels[1][0].set_ylabel("basis vector", fontsize=11)
    bar = figure.colorbar(drawn, ax=panels[0], aspect=12, pad=0.01)
    bar.set_label("field / its largest\nmagnitude", fontsize=10)
    handles, labels = panels[1][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def draw_prediction(flag: Flag) -> Any:
    """A field, and its residuals for three sets of weights."""
    field, mesh, order = flag.fields[:, PREDICTED], flag.mesh.hierarchy, flag.mesh.order
    near = (mesh.stencil >= 0) / np.maximum(mesh.hops, 1.0) ** 2
    near /= np.maximum(near.sum(axis=1, keepdims=True), 1e-12)
    by_distance = np.empty(len(field))
    by_distance[order] = (near * field[order][mesh.stencil]).sum(axis=1)
    predicted_fields = np.stack(
        [by_distance, *(predictions(flag, flag.fields, n)[:, PREDICTED] for n in (0, N_KNOWN))]
    )
    figure, panels = plt.subplots(1, 4, figsize=(13, 3.4), layout="constrained")
    drawn = draw_field(panels[0], flag, field, None)
    panels[0].set_title(f"field of mode {PREDICTED + 1}\nrms {rms(field):.0f} steps", fontsize=10)
    figure.colorbar(drawn, ax=panels[0], shrink=0.8, location="bottom")
    names = ("weights by distance", "first weights", f"after {N_KNOWN} fields")
    for panel, name, predicted in zip(panels[1:], names, predicted_fields, strict=True):
        residual = field - predicted
        fine = np.concatenate(flag.resolutions[-1])
        drawn = draw_field(panel, flag, residual, 3.0)
        panel.set_title(
            f"residual, {name}\nrms {rms(residual[fine]):.2f} steps on the finest resolution",
            fontsize=10,
        )
    figure.colorbar(
        drawn, ax=panels[1:], shrink=0.8, aspect=40, location="bottom", label="quantization steps"
    )
    return figure


def draw_ablation() -> Any:
    """Effect of parts of the method, from the table of docs/codec.md, with a mark per sequence."""
    text = (ROOT / "docs" / "codec.md").read_text(encoding="utf-8")
    table = text[text.index("| KG, STED |") :].split("\n\n")[0].splitlines()
    sequences = [cell.strip() for cell in table[0].split("|")[2:-1]]
    rows = {
        cells[1].strip(): np.array([numbers(cell) for cell in cells[2:-1]])
        for cells in (line.split("|") for line in table[2:])
    }
    shown = [name for name in rows if not name.startswith("blocks")]
    figure, panels = plt.subplots(1, 2, figsize=(11, 7), sharey=True, layout="constrained")
    for panel, column, measure in zip(panels, (0, 1), ("KG error", "STED"), strict=True):
        for place, name in enumerate(shown):
            values = rows[name][:, column]
            mean = values.mean()
            panel.barh(
                place, mean, color="#D9DFE8", height=0.75, label="mean" if not place else None
            )
            panel.text(
                max(values.max(), 0), place, f"  {mean:+.1f}",
                va="center", fontsize=8.5, color="#444444",
            )  # fmt: skip
            for value, style, sequence in zip(values, SEQUENCE_STYLES, sequences, strict=True):
                marker, color = style
                panel.plot(
                    value, place, marker, color=color, fillstyle="none", ms=5, mew=1.1,
                    label=sequence if not place else None, ls="none",
                )  # fmt: skip
        panel.axvline(0, color="#222222", lw=0.8)
        panel.margins(x=0.12, y=0.01)
        panel.grid(axis="x", alpha=0.3)
        panel.set_axisbelow(True)
        panel.set_title(f"at equal {measure}", fontsize=11)
        panel.set_xlabel("change of the rate, %")
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_yticks(range(len(shown)), shown, fontsize=9.5)
    panels[0].invert_yaxis()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=7, frameon=False)
    return figure


def numbers(cell: str) -> tuple[float, float]:
    """The two rates of a cell such as "+50.7, +92.9"."""
    first, second = re.findall(r"[-+][\d.]+", cell)
    return float(first), float(second)


def rms(values: Floats) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def draw_edges(panel: Any, positions: Floats, edges: Integers) -> None:
    """Draw edges of shape (E, 2) between vertices at these positions."""
    segments: Any = positions[edges]
    panel.add_collection(LineCollection(segments, colors="#BBBBBB", linewidths=0.6, zorder=1))


def coarser_edges(edges: Integers, kept: Integers, n_verts: int) -> Integers:
    """Edges of the next coarser resolution: those between the cells of the kept vertices."""
    is_kept = np.zeros(n_verts, np.bool_)
    is_kept[kept] = True
    cell = np.where(is_kept, np.arange(len(is_kept)), -1)
    both = np.concatenate([edges, edges[:, ::-1]])
    links = both[~is_kept[both[:, 0]] & is_kept[both[:, 1]]]
    np.maximum.at(cell, links[:, 0], links[:, 1])
    ends = np.sort(cell[edges], axis=1)
    return np.unique(ends[ends[:, 0] < ends[:, 1]], axis=0)


def dots(panel: Any, positions: Floats, color: str, label: str) -> None:
    """Draw vertices as dots."""
    panel.scatter(*positions.T, s=14, c=color, label=label, zorder=2)


def draw_field(panel: Any, flag: Flag, field: Floats, limit: float | None) -> Any:
    """Draw a field in color on the flag at rest."""
    drawn = panel.tripcolor(
        *flag.flat.T, flag.faces, field, shading="gouraud", cmap=SIGNED,
        norm=CenteredNorm(halfrange=limit),
    )  # fmt: skip
    panel.set_aspect("equal")
    panel.set_xticks([])
    panel.set_yticks([])
    panel.spines[:].set_visible(False)
    return drawn


def crop(panel: Any, flag: Flag, side: float, center: Floats | None = None) -> None:
    """Show a square part of the flag, around a center or in the corner."""
    low = flag.flat.min(axis=0) - 0.01 if center is None else center - side / 2
    panel.set_xlim(low[0], low[0] + side)
    panel.set_ylim(low[1], low[1] + side)
    panel.set_aspect("equal")
    panel.set_xticks([])
    panel.set_yticks([])


def main() -> None:
    """Write all figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images")
    parser.add_argument("--frames", type=int, default=300, help="of the flag")
    arguments = parser.parse_args()
    plt.switch_backend("agg")
    flag = analyzed_flag(arguments.frames)
    figures = {
        "hierarchy": draw_hierarchy(flag),
        "stencil": draw_stencil(flag),
        "modes": draw_modes(flag),
        "prediction": draw_prediction(flag),
        "ablation": draw_ablation(),
    }
    for name, figure in figures.items():
        figure.savefig(arguments.out / f"method-{name}.png", dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
