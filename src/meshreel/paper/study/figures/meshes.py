"""Rendered meshes: Fig. 3 (growing numbers of rows) and Fig. 7 (all variants)."""

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.decoder import decode
from meshreel.metrics.heat import vertex_normal_angle_deg
from meshreel.model.sequence import Faces, MeshSequence
from meshreel.paper.study.results import label_of_result, method_of_result, setting_of_result
from meshreel.rendering.camera import Camera, fit_camera
from meshreel.rendering.color_bars import draw_color_bar
from meshreel.rendering.colormap import Image, colorize, round_up
from meshreel.rendering.documents import Picture
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.rendering.rasterizer import render
from meshreel.rendering.studio import GLOW
from meshreel.rendering.visibility import inverse_depths, visible_faces
from meshreel.studies.runs import Result, Store, usable

Frame = npt.NDArray[np.floating]

PANEL_PX = 270
"""Side of a square panel; other panels have this area."""

SHEET_PX, SHEET_DPI = 1700, 170
"""Width within which columns fit, and a resolution at which titles are as large as text."""

GAP_PX, LINE_PX, LETTER_PX = 16, 23, 11
"""Space between panels, height of a line of a title, and width of its letters."""

MAX_ASPECT = 2.5  # of a panel, and its inverse
ENLARGEMENT = 3
"""Magnification of the details in Fig. 7."""

MARK_COLOR = (213, 94, 0)
HEAT_PERCENTILE, HEAT_METHODS = 98.0, ("pca-qs", "pca-qp", "blocks")
"""The color scale ends at this percentile of the angles of these methods, if available."""


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
    shown = []
    for result in usable(results):
        modes, error = setting_of_result(result).n_modes, result["quality"]["kg_error_percent"]
        title = f"k_l = {modes}\nKG {error:.3g} %"
        shown.append((title, _decoded_frame(result, store, frame)))
    shown.append((f"original\nframe {frame}", original))
    camera = _camera(original)
    columns = [(title, [render(vertices, sequence.faces, camera)]) for title, vertices in shown]
    path = folder / f"{slug}-fig3-rows.png"
    save_sheet(columns, path)
    caption = (
        f"Frame {frame} of {sequence.n_frames}, which differs most from the mean shape, decoded "
        "from the first k_l rows of coefficients (`pca-qp`), and the original. KG is the error of "
        "the whole sequence."
    )
    return Picture(path, "Fig. 3", caption, len(columns))


def draw_variants(
    sequence: MeshSequence, results: Sequence[Result], store: Store, slug: str, folder: Path
) -> Picture:
    """Fig. 7: the original and every variant, with an enlarged detail and errors of normals."""
    frame = uncommon_frame(sequence)
    original, faces, shown = sequence.vertices[frame], sequence.faces, usable(results)
    decoded = [_decoded_frame(result, store, frame) for result in shown]
    angles = [vertex_normal_angle_deg(original, vertices, faces) for vertices in decoded]
    # The top of the color scale distinguishes the better variants.
    better = [
        angle
        for result, angle in zip(shown, angles, strict=True)
        if method_of_result(result) in HEAT_METHODS
    ]
    top_deg = round_up(float(np.percentile(np.concatenate(better or angles), HEAT_PERCENTILE)))
    camera = _camera(original)
    size = camera.width // ENLARGEMENT, camera.height // ENLARGEMENT
    corner = detail_corner(original, faces, np.minimum(angles, top_deg), camera, size)
    titles = [f"original\nframe {frame}"]
    for result, angle in zip(shown, angles, strict=True):
        sted = result["quality"]["sted"]
        titles.append(f"{label_of_result(result)}\nSTED {sted:.4f}\nangle {angle.mean():.2f}°")
    columns: list[tuple[str, list[Image]]] = []
    for number, vertices in enumerate([original, *decoded]):
        shaded = render(vertices, faces, camera)
        detail = render_detail(vertices, faces, camera, corner, size)
        if number == 0:
            shaded = _outline(shaded, corner, size)
            heat = draw_color_bar(0.0, top_deg, unit="degrees", height=max(camera.height, 80))
        else:
            colors = colorize(angles[number - 1], 0.0, top_deg)
            heat = render(vertices, faces, camera, colors=colors, glow=GLOW)
        detail = _outline(detail, (0, 0), (detail.shape[1], detail.shape[0]))
        columns.append((titles[number], [shaded, detail, heat]))
    path = folder / f"{slug}-fig7-variants.png"
    save_sheet(columns, path, ("shaded", f"detail, {ENLARGEMENT} times", "error of normals"))
    caption = (
        f"Frame {frame} of {sequence.n_frames}, rendered with one camera. Below each panel: the "
        f"detail inside the rectangle of the picture, enlarged {ENLARGEMENT} times, where the "
        "errors of the variants differ most (interquartile range). Below that: the mean angle "
        "between original and decoded normals of the faces around each vertex; yellow is "
        f"{top_deg:g} degrees or more. STED covers the whole sequence; the angle in a title is the "
        "mean over this frame."
    )
    return Picture(path, "Fig. 7", caption, 3 * len(shown) + 2)


def save_sheet(
    columns: Sequence[tuple[str, list[Image]]], path: Path, row_titles: Sequence[str] = ()
) -> None:
    """Write columns of panels with titles, wrapped into several bands if they are too wide."""
    heights, width = [len(panel) for panel in columns[-1][1]], columns[-1][1][0].shape[1]
    n_bands = -(-len(columns) // max(1, SHEET_PX // width))
    n_across = -(-len(columns) // n_bands)
    left = 3 * GAP_PX if row_titles else GAP_PX
    titles = [
        "\n".join(textwrap.fill(line, width // LETTER_PX) for line in title.splitlines())
        for title, _ in columns
    ]
    title_px = LINE_PX * max(len(title.splitlines()) for title in titles) + GAP_PX
    band_px = title_px + sum(height + GAP_PX for height in heights)
    sheet_width, sheet_height = left + n_across * (width + GAP_PX), n_bands * band_px
    figure = blank_figure(sheet_width / SHEET_DPI, sheet_height / SHEET_DPI)

    def write(text: str, x: float, y: float, **style: Any) -> None:
        figure.text(x / sheet_width, 1 - y / sheet_height, text, fontsize=8, ha="center", **style)

    for number, (title, (_, panels)) in enumerate(zip(titles, columns, strict=True)):
        band, column = divmod(number, n_across)
        x, y = left + column * (width + GAP_PX), band * band_px + title_px
        write(title, x + width / 2, y - GAP_PX / 2, va="bottom")
        for row, (panel, height) in enumerate(zip(panels, heights, strict=True)):
            if row_titles and column == 0:
                write(row_titles[row], left / 2, y + height / 2, va="center", rotation=90)
            centered_x = x + (width - panel.shape[1]) // 2
            figure.figimage(panel, centered_x, sheet_height - y - len(panel), origin="upper")
            y += height + GAP_PX
    save_figure(figure, path, overwrite=True, dpi=SHEET_DPI)


def detail_corner(
    original: Frame,
    faces: Faces,
    angles: Sequence[Floats] | Floats,
    camera: Camera,
    size: tuple[int, int],
) -> tuple[int, int]:
    """Find the part of a picture where the errors of variants differ most.

    Each pixel is weighted by the squared interquartile range of the angles of its face over all
    variants: pixels where all are equally wrong have no weight, a single bad variant has little,
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
    visible = visible_faces(points, inverse_depths(depths), faces, (camera.width, camera.height))
    if len(angles) == 1:
        angles = [np.zeros(len(original)), *angles]
    face_angles = np.array([angle[faces].mean(axis=1) for angle in angles])
    differences = np.subtract(*np.percentile(face_angles, (75, 25), axis=0)) ** 2
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
) -> Image:
    """Render a part of a camera's picture at `ENLARGEMENT` times its resolution.

    Parameters
    ----------
    corner, size : tuples of int
        Left and top, width and height of the part, in pixels of the camera.
    """
    enlarged = replace(
        camera,
        focal_px=ENLARGEMENT * camera.focal_px,
        width=ENLARGEMENT * camera.width,
        height=ENLARGEMENT * camera.height,
    )
    (left, top), (width, height) = (ENLARGEMENT * np.array(pair) for pair in (corner, size))
    return render(vertices, faces, enlarged)[top : top + height, left : left + width]


def _outline(image: Image, corner: tuple[int, int], size: tuple[int, int]) -> Image:
    """The image with a thin rectangle around a part of it."""
    outlined = image.copy()
    outlined[corner[1] : corner[1] + size[1], corner[0] : corner[0] + size[0]] = MARK_COLOR
    inside = (
        slice(corner[1] + 2, corner[1] + size[1] - 2),
        slice(corner[0] + 2, corner[0] + size[0] - 2),
    )
    outlined[inside] = image[inside]
    return outlined


def _camera(vertices: Frame) -> Camera:
    """The camera that fits one frame into a panel of the frame's aspect ratio."""
    points, _ = fit_camera(vertices, width=400, height=400).project(vertices)
    width, height = np.ptp(points, axis=0)
    aspect = np.clip(width / max(height, 1e-9), 1 / MAX_ASPECT, MAX_ASPECT) ** 0.5
    # Multiples of the enlargement, so that details are as large as panels.
    width, height = (
        ENLARGEMENT * round(PANEL_PX * factor / ENLARGEMENT) for factor in (aspect, 1 / aspect)
    )
    return fit_camera(vertices, width=int(width), height=int(height), margin=0.06)


def _decoded_frame(result: Result, store: Store, frame: int) -> Frame:
    """The decoded frame stored with a result, or decoded from its stream."""
    key = setting_of_result(result).key
    try:
        vertices: Frame = np.load(store.path(key, "npy"), allow_pickle=False)
    except (OSError, ValueError):
        data = store.path(key, "reel").read_bytes()
        vertices = decode(data, frames=slice(frame, frame + 1)).vertices[0]
    return vertices
