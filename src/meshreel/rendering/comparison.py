"""Original and decoded side by side, with a heat map of where they differ."""

import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage

from meshreel.rendering.camera import Camera, fit_camera
from meshreel.rendering.colormap import colorize, draw_color_bar
from meshreel.rendering.picture import contact_sheet
from meshreel.rendering.rasterizer import render
from meshreel.sequence import MeshSequence

PANEL_PX = (420, 300)


def comparison_picture(
    original: MeshSequence,
    decoded: MeshSequence,
    *,
    n_poses: int = 3,
    caption: str = "",
    size_px: tuple[int, int] = PANEL_PX,
) -> PillowImage.Image:
    """A sheet: a row for each pose, with the original, the decoded and the error of each vertex.

    Parameters
    ----------
    original, decoded : MeshSequence
        Of the same vertices, faces and frames.
    n_poses : int, default 3
        Frames shown, spread evenly over the sequence from after its start to its end.
    caption : str
        A line below.
    size_px : tuple of 2 ints
        Width and height of each panel.
    """
    width, height = size_px
    camera = fit_camera(original.vertices, width=width, height=height)
    frames = np.linspace(0, original.n_frames - 1, n_poses + 1)[1:].round().astype(int)
    errors = _errors_percent(original, decoded, frames)
    largest = float(errors.max(initial=0.0)) or 1.0
    rows = [
        _row(original, decoded, int(frame), error, largest, camera)
        for frame, error in zip(frames, errors, strict=True)
    ]
    bar = draw_color_bar(0.0, largest, unit="% of the diagonal", height=height)
    rows[0].append(bar)
    return contact_sheet(
        rows,
        column_titles=["original", "decoded", "distance of each vertex", ""],
        row_titles=[f"frame {frame}" for frame in frames],
        caption=caption,
    )


def _row(
    original: MeshSequence,
    decoded: MeshSequence,
    frame: int,
    error_percent: npt.NDArray[np.float64],
    largest: float,
    camera: Camera,
) -> list[npt.NDArray[np.uint8]]:
    heat = colorize(error_percent, 0.0, largest)
    return [
        render(original.vertices[frame], original.faces, camera),
        render(decoded.vertices[frame], decoded.faces, camera),
        render(decoded.vertices[frame], decoded.faces, camera, colors=heat),
    ]


def _errors_percent(
    original: MeshSequence, decoded: MeshSequence, frames: npt.NDArray[np.int64]
) -> npt.NDArray[np.float64]:
    """Vertex distances of shape (poses, V), in percent of the whole sequence's diagonal."""
    box = np.ptp(original.vertices, axis=(0, 1)).astype(np.float64)
    diagonal = float(np.linalg.norm(box)) or 1.0
    shift = decoded.vertices[frames].astype(np.float64) - original.vertices[frames]
    return np.asarray(100 * np.linalg.norm(shift, axis=2) / diagonal)
