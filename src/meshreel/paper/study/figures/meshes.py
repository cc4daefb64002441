"""Rendered meshes: Fig. 3 (growing numbers of rows) and Fig. 7 (all variants)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.decoder import decode
from meshreel.evaluation.runs.store import Result, Store, done
from meshreel.metrics.heat import vertex_normal_angle_deg
from meshreel.model.sequence import Faces, MeshSequence
from meshreel.paper.study.figures.panels import (
    FONT_SIZE,
    ROW_LABEL_PX,
    Box,
    Layout,
    axes_in,
    draw_sheet,
    fit_layout,
    save_for_print,
    show_image,
)
from meshreel.paper.study.results import label_of_result, method_of_result, setting_of_result
from meshreel.rendering.camera import Camera, fit_camera
from meshreel.rendering.colormap import HEAT, colorize, round_up
from meshreel.rendering.documents import Picture
from meshreel.rendering.rasterizer import render
from meshreel.rendering.visibility import nearness, visible_faces

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Frame = npt.NDArray[np.floating]

MAX_ASPECT = 2.5  # of a panel, and its inverse
ENLARGEMENT = 3
"""Magnification of the details in Fig. 7."""

MARK_COLOR = "#D55E00"
HEAT_PERCENTILE, HEAT_METHODS = 98.0, ("pca-qs", "pca-qp", "blocks")
"""The color scale ends at this percentile of the angles of these methods, if available."""

HEAT_GLOW = 0.4
"""Unlit share of the heat map's colors, so that they match the color bar."""


def uncommon_frame(sequence: MeshSequence) -> int:
    """The frame with the largest distance from the mean shape."""
    vertices = sequence.vertices.astype(np.float64)
    centered = vertices - vertices.mean(axis=1, keepdims=True)
    distances = ((centered - centered.mean(axis=0)) ** 2).sum(axis=(1, 2))
    return int(np.argmax(distances))


def draw_row_counts(
    sequence: MeshSequence, results: Sequence[Result], store: Store, slug: str, folder: Path
) -> Picture:
    """Fig. 3: one frame with growing numbers of rows, and the original."""
    frame = uncommon_frame(sequence)
    original = sequence.vertices[frame]
    shown = [(_decoded_frame(result, store, frame), _row_title(result)) for result in done(results)]
    shown.append((original, f"original\nframe {frame}"))
    layout = fit_layout(len(shown), [_aspect(original)], 2, has_labels=False)
    camera = _camera(original, layout)
    figure = draw_sheet(layout, [title for _, title in shown])
    for column, (vertices, _) in enumerate(shown):
        show_image(figure, layout.cell(column, 0), render(vertices, sequence.faces, camera))
    path = folder / f"{slug}-fig3-rows.png"
    save_for_print(figure, path)
    caption = (
        f"Frame {frame} of {sequence.n_frames}, which differs most from the mean shape, decoded "
        "from the first k_l rows of coefficients (`pca-qp`), and the original. KG is the error of "
        "the whole sequence."
    )
    return Picture(path, "Fig. 3", caption, len(shown))


def draw_variants(
    sequence: MeshSequence, results: Sequence[Result], store: Store, slug: str, folder: Path
) -> Picture:
    """Fig. 7: the original and every variant, with an enlarged detail and errors of normals."""
    frame = uncommon_frame(sequence)
    original, faces, shown = sequence.vertices[frame], sequence.faces, done(results)
    decoded = [_decoded_frame(result, store, frame) for result in shown]
    angles = [vertex_normal_angle_deg(original, vertices, faces) for vertices in decoded]
    top_deg = _heat_top_deg(shown, angles)
    aspect = _aspect(original)
    layout = fit_layout(1 + len(shown), [aspect, max(aspect, 1.0), aspect], n_title_lines=3)
    camera = _camera(original, layout)
    size = layout.width // ENLARGEMENT, layout.heights[1] // ENLARGEMENT
    corner = detail_corner(original, faces, np.minimum(angles, top_deg), camera, size)
    titles = [f"original\nframe {frame}"]
    titles += [_variant_title(*pair) for pair in zip(shown, angles, strict=True)]
    figure = draw_sheet(
        layout, titles, ["shaded", f"detail, {ENLARGEMENT} times", "error of normals"]
    )
    for column, vertices in enumerate([original, *decoded]):
        shaded = show_image(figure, layout.cell(column, 0), render(vertices, faces, camera))
        image = render_detail(vertices, faces, camera, corner, size)
        detail = show_image(figure, layout.cell(column, 1), image)
        detail.spines[:].set(visible=True, color=MARK_COLOR, linewidth=0.6)
        if column == 0:
            _mark(shaded, corner, size)
            exceeds = any(angle.max() > top_deg for angle in angles)
            _draw_heat_bar(figure, layout.cell(0, 2), top_deg, exceeds=exceeds)
        else:
            colors = colorize(angles[column - 1], 0.0, top_deg)
            heat = render(vertices, faces, camera, colors=colors, glow=HEAT_GLOW)
            show_image(figure, layout.cell(column, 2), heat)
    path = folder / f"{slug}-fig7-variants.png"
    save_for_print(figure, path)
    caption = (
        f"Frame {frame} of {sequence.n_frames}, rendered with one camera. Below each panel: the "
        f"detail inside the rectangle of the picture, enlarged {ENLARGEMENT} times, where the "
        "errors of the variants differ most (interquartile range). Below that: the mean angle "
        "between original and decoded normals of the faces around each vertex; yellow is "
        f"{top_deg:g} degrees or more. STED covers the whole sequence; the angle in a title is the "
        "mean over this frame."
    )
    return Picture(path, "Fig. 7", caption, 3 * len(shown) + 2)


def detail_corner(
    original: Frame,
    faces: Faces,
    angles: Sequence[Floats] | Floats,
    camera: Camera,
    size: tuple[int, int],
) -> tuple[int, int]:
    """Find the part of a picture where the errors of variants differ most.

    Each pixel is weighted by the squared interquartile range of the angles of its face over all
    variants: places where all are equally wrong have no weight, a single bad variant has little,
    and a few large differences count more than many invisible ones. A single variant is compared
    with the original. Hidden faces have no pixels, and the background no weight.

    Parameters
    ----------
    original : float array of shape (V, 3)
    faces : integer array of shape (M, 3)
    angles : float64 arrays of shape (V,)
        One for each variant, in degrees.
    size : tuple of int
        Width and height of the part, in pixels; at most those of the picture.

    Returns
    -------
    Left and top pixel of the part. If no visible face differs, the part with the largest visible
    area of the mesh.
    """
    points, depths = camera.project(original)
    visible = visible_faces(points, nearness(depths), faces, (camera.width, camera.height))
    if len(angles) == 1:
        angles = [np.zeros(len(original)), *angles]
    of_faces = np.array([angle[faces].mean(axis=1) for angle in angles])
    differences = np.subtract(*np.percentile(of_faces, (75, 25), axis=0)) ** 2
    weights = np.zeros(len(visible))
    weights[visible >= 0] = differences[visible[visible >= 0]]
    if not weights.any():
        weights[visible >= 0] = 1.0
    width, height = size
    sums = np.pad(weights.reshape(camera.height, camera.width), ((1, 0), (1, 0)))
    sums = sums.cumsum(axis=0).cumsum(axis=1)
    inside = sums[height:, width:] - sums[:-height, width:]
    inside -= sums[height:, :-width] - sums[:-height, :-width]
    top, left = np.unravel_index(np.argmax(inside), inside.shape)
    return int(left), int(top)


def render_detail(
    vertices: Frame, faces: Faces, camera: Camera, corner: tuple[int, int], size: tuple[int, int]
) -> npt.NDArray[np.uint8]:
    """Render a part of a camera's picture at `ENLARGEMENT` times its resolution.

    Parameters
    ----------
    vertices : float array of shape (V, 3)
    faces : integer array of shape (M, 3)
    corner, size : tuples of int
        Left and top, width and height of the part, in pixels of the camera.
    """
    enlarged = replace(
        camera,
        focal_px=ENLARGEMENT * camera.focal_px,
        width=ENLARGEMENT * camera.width,
        height=ENLARGEMENT * camera.height,
    )
    (left, top), (width, height) = (
        (ENLARGEMENT * pair[0], ENLARGEMENT * pair[1]) for pair in (corner, size)
    )
    return render(vertices, faces, enlarged)[top : top + height, left : left + width]


def _row_title(result: Result) -> str:
    modes, error = setting_of_result(result).n_modes, result["quality"]["kg_error_percent"]
    return f"$k_l$ = {modes}\nKG {error:.3g} %"


def _variant_title(result: Result, angle: Floats) -> str:
    sted = result["quality"]["sted"]
    return f"{label_of_result(result)}\nSTED {sted:.4f}\nangle {angle.mean():.2f}°"


def _aspect(vertices: Frame) -> float:
    """Aspect ratio, width over height, of a panel for one frame."""
    points, _ = fit_camera(vertices, width=400, height=400).project(vertices)
    width, height = np.ptp(points, axis=0)
    return float(np.clip(width / max(height, 1e-9), 1 / MAX_ASPECT, MAX_ASPECT))


def _camera(vertices: Frame, layout: Layout) -> Camera:
    """The camera that fits one frame into the first panel of each column."""
    return fit_camera(vertices, width=layout.width, height=layout.heights[0], margin=0.06)


def _mark(axes: "Axes", corner: tuple[int, int], size: tuple[int, int]) -> None:
    """Draw a thin rectangle around a part of an image."""
    from matplotlib.patches import Rectangle

    left, top = corner[0] - 0.5, corner[1] - 0.5
    axes.add_patch(Rectangle((left, top), *size, fill=False, edgecolor=MARK_COLOR, linewidth=0.8))


def _draw_heat_bar(figure: "Figure", cell: Box, top_deg: float, *, exceeds: bool) -> None:
    """Draw the color bar of the heat maps inside an empty cell."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    colormap = LinearSegmentedColormap.from_list("heat", HEAT / 255)
    height = 0.8 * cell.height
    width = min(0.08 * cell.width, 0.15 * height)
    top = cell.top + (cell.height - height) / 2
    axes = axes_in(figure, Box(cell.left + 0.35 * cell.width, top, width, height))
    shades = ScalarMappable(Normalize(0.0, top_deg), colormap)
    bar = figure.colorbar(shades, cax=axes, extend="max" if exceeds else "neither")
    ticks = [top_deg * fifth / 5 for fifth in range(6)]
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    size = FONT_SIZE * min(1.0, height / ROW_LABEL_PX)
    bar.set_label("angle (degrees)", fontsize=size)
    axes.tick_params(labelsize=size - 1)


def _heat_top_deg(results: Sequence[Result], angles: Sequence[Floats]) -> float:
    """The top of the color scale, chosen to distinguish the better variants."""
    solved = [
        angle
        for result, angle in zip(results, angles, strict=True)
        if method_of_result(result) in HEAT_METHODS
    ]
    values = np.concatenate(solved or list(angles))
    return round_up(float(np.percentile(values, HEAT_PERCENTILE)))


def _decoded_frame(result: Result, store: Store, frame: int) -> Frame:
    """The decoded frame stored with a result, or decoded from its stream."""
    key = setting_of_result(result).key
    try:
        vertices: Frame = np.load(store.path(key, "npy"), allow_pickle=False)
    except (OSError, ValueError):
        data = store.path(key, "reel").read_bytes()
        vertices = decode(data, frames=slice(frame, frame + 1)).vertices[0]
    return vertices
