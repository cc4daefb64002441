"""Rendered meshes: Fig. 3 (growing numbers of rows) and Fig. 7 (all variants)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage

from meshreel.codec.decoder import decode
from meshreel.documents.parts import Picture
from meshreel.evaluation.paper.results import label_of_result, method_of_result, setting_of_result
from meshreel.evaluation.runs.store import Result, Store, done
from meshreel.metrics.heat import vertex_normal_angle_deg
from meshreel.rendering.camera import Camera, fit_camera
from meshreel.rendering.colormap import colorize, draw_color_bar
from meshreel.rendering.picture import contact_sheet, save_png
from meshreel.rendering.rasterizer import render
from meshreel.sequence import MeshSequence

Floats = npt.NDArray[np.float64]

PANEL_AREA_PX = 380 * 380
PANELS_IN_A_ROW = 5
HEAT_PERCENTILE, HEAT_METHODS = 98.0, ("pca-qs", "pca-qp", "blocks")
"""The top of the colour scale: that percentile of the angles of these, where they were run."""


def telling_frame(sequence: MeshSequence) -> int:
    """The frame whose shape is farthest from the mean shape: an uncommon pose, well to see."""
    vertices = sequence.vertices.astype(np.float64)
    centred = vertices - vertices.mean(axis=1, keepdims=True)
    distances = ((centred - centred.mean(axis=0)) ** 2).sum(axis=(1, 2))
    return int(np.argmax(distances))


def draw_row_counts(
    sequence: MeshSequence, results: Sequence[Result], store: Store, slug: str, folder: Path
) -> Picture:
    """Fig. 3: one frame with growing numbers of rows, and the original."""
    frame = telling_frame(sequence)
    camera = _camera(sequence.vertices[frame])
    panels, titles = [], []
    for result in done(results):
        quality, modes = result["quality"], result["identity"]["setting"]["n_modes"]
        vertices = _shown(result, store, frame)
        panels.append(render(vertices, sequence.faces, camera))
        titles.append(f"k_l = {modes}\nKG {quality['kg_error_percent']:.3g} %")
    panels.append(render(sequence.vertices[frame], sequence.faces, camera))
    titles.append(f"original\nframe {frame}")
    path = folder / f"{slug}-fig3-rows.png"
    save_png(contact_sheet([panels], column_titles=titles), path, overwrite=True)
    caption = (
        f"Frame {frame} of {sequence.n_frames} decoded from the first k_l rows (`pca-qp`, 8 bits, "
        "1 % anchors), and the original. KG error of the whole sequence."
    )
    return Picture(path, "Fig. 3", caption, len(panels))


def draw_variants(
    sequence: MeshSequence, results: Sequence[Result], store: Store, slug: str, folder: Path
) -> Picture:
    """Fig. 7: the original and every variant, with STED and the angles between normals."""
    frame = telling_frame(sequence)
    original = sequence.vertices[frame]
    camera = _camera(original)
    shown = done(results)
    decoded = [_shown(result, store, frame) for result in shown]
    angles = [vertex_normal_angle_deg(original, vertices, sequence.faces) for vertices in decoded]
    top_deg = _heat_top_deg(shown, angles)
    shaded = [render(original, sequence.faces, camera)]
    heat: list[PillowImage.Image | npt.NDArray[np.uint8]] = [
        draw_color_bar(0.0, top_deg, unit="degrees", height=camera.height)
    ]
    titles = [f"original\nframe {frame}"]
    for result, vertices, angle in zip(shown, decoded, angles, strict=True):
        shaded.append(render(vertices, sequence.faces, camera))
        colors = colorize(angle, 0.0, top_deg)
        heat.append(render(vertices, sequence.faces, camera, colors=colors))
        titles.append(
            f"{label_of_result(result)}\nSTED {result['quality']['sted']:.4f}\n"
            f"angle {angle.mean():.2f}°"
        )
    path = folder / f"{slug}-fig7-variants.png"
    save_png(_stacked(shaded, heat, titles), path, overwrite=True)
    caption = (
        f"Frame {frame} of {sequence.n_frames}, the same camera for all. Above: shaded. Below: "
        "mean angle between original and decoded normals of the faces about each vertex; angles "
        f"from {top_deg:.3g} degrees on are yellow. STED is of the whole sequence, the mean "
        "angle of this frame."
    )
    return Picture(path, "Fig. 7", caption, 2 * len(shown) + 1)


def _stacked(
    shaded: Sequence[npt.NDArray[np.uint8]],
    heat: Sequence[PillowImage.Image | npt.NDArray[np.uint8]],
    titles: Sequence[str],
) -> PillowImage.Image:
    """Sheets of shaded panels over their heat maps, a few side by side in each."""
    n_columns = min(len(shaded), PANELS_IN_A_ROW)
    n_blank = -len(shaded) % n_columns  # fills the last sheet, so that all are laid out alike
    blank = [np.full_like(shaded[0], 255)] * n_blank
    rows, titles = ([*shaded, *blank], [*heat, *blank]), [*titles, *[""] * n_blank]
    sheets = []
    for start in range(0, len(titles), n_columns):
        part = slice(start, start + n_columns)
        sheets.append(contact_sheet([row[part] for row in rows], column_titles=titles[part]))
    size = sheets[0].width, sum(sheet.height for sheet in sheets)
    whole = PillowImage.new("RGB", size, (255, 255, 255))
    y = 0
    for sheet in sheets:
        whole.paste(sheet, (0, y))
        y += sheet.height
    return whole


def _camera(vertices: npt.NDArray[np.floating]) -> Camera:
    """A camera that fits one frame, upright or lying as the model is."""
    wide = fit_camera(vertices, width=400, height=400)
    points, _ = wide.project(vertices)
    width, height = np.ptp(points, axis=0)
    aspect = float(np.clip(width / max(height, 1e-9), 0.4, 2.5))
    width_px, height_px = np.sqrt(PANEL_AREA_PX * aspect), np.sqrt(PANEL_AREA_PX / aspect)
    return fit_camera(vertices, width=round(width_px), height=round(height_px), margin=0.06)


def _heat_top_deg(results: Sequence[Result], angles: Sequence[Floats]) -> float:
    """The top of the colour scale: that of the better variants, so that they differ to the eye."""
    solved = [
        angle
        for result, angle in zip(results, angles, strict=True)
        if method_of_result(result) in HEAT_METHODS
    ]
    values = np.concatenate(solved or list(angles))
    return float(np.percentile(values, HEAT_PERCENTILE)) or 1.0


def _shown(result: Result, store: Store, frame: int) -> npt.NDArray[np.floating]:
    """The decoded frame that was stored with a result; from its stream where that is missing."""
    key = setting_of_result(result).key
    try:
        vertices: npt.NDArray[np.floating] = np.load(store.path(key, "npy"), allow_pickle=False)
    except (OSError, ValueError):
        data = store.path(key, "reel").read_bytes()
        vertices = decode(data, frames=slice(frame, frame + 1)).vertices[0]
    return vertices
