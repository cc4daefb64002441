"""A picture of selected frames: a contact sheet, or a comparison with one row per frame."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage

from meshreel.errors import InvalidInputError
from meshreel.model.frame_choice import spread_frames
from meshreel.rendering.painting import Image
from meshreel.rendering.scenes import Scene
from meshreel.rendering.sheets import Sheet, Size, plan_sheet
from meshreel.rendering.shots import (
    ASPECT_FRAMES,
    MAX_TRAVEL,
    draw_shots,
    frame_labels,
    framing_of,
    scene_annotations,
)
from meshreel.rendering.views import View
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.progress import Count, Progress, silent

STILL_PX: Size = (1600, 1000)
"""Largest sheet by default."""


def still(
    scene: Scene,
    numbers: Sequence[int],
    view: View,
    *,
    size: Size | None = None,
    caption: str = "",
    is_followed: bool | None = None,
    progress: Progress = silent,
) -> PillowImage.Image:
    """Draw frames in a grid, or in one row each if the scene has several views.

    Parameters
    ----------
    numbers : sequence of int
        Frame numbers, at least one; a single frame of a scene of one view fills the picture.
    size : tuple of 2 ints, optional
        Width and height in pixels. Default: fits the content.
    caption : str
        Text at the bottom.
    is_followed : bool, optional
        Whether the camera follows the mesh. Default: if it would otherwise be small or off-center.

    Raises
    ------
    InvalidInputError
        If the size is too small.
    """
    n_views = len(numbers) * len(scene.titles)
    scales = scene.scales(numbers, progress)
    labels = [label for number in numbers for label in frame_labels(scene, number)]
    annotations = scene_annotations(scene, scales, labels if n_views > 1 else (), caption)
    sample = scene.frames(spread_frames(numbers, ASPECT_FRAMES))
    framing = framing_of(view, sample, is_followed=is_followed, max_travel=MAX_TRAVEL)
    layout = plan_sheet(annotations, n_views, framing.aspect(sample), size, STILL_PX)
    cameras = framing.cameras(scene.frames(numbers), *layout.view_size)
    views: list[Image] = []
    for frame_views in draw_shots(scene, list(zip(numbers, cameras, strict=True)), scales):
        views += frame_views
        progress("drawing", Count(len(views), n_views, "views"))
    return Sheet(layout, annotations, scene.background).compose(
        views, labels if n_views > 1 else ()
    )


def save_png(
    image: npt.NDArray[np.uint8] | PillowImage.Image, path: Path, *, overwrite: bool = False
) -> None:
    """Write a picture as a PNG file, atomically.

    Parameters
    ----------
    image : Pillow image, or uint8 array of shape (H, W, 3)
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InvalidInputError
        If the image has the wrong type or shape, or the path cannot or must not be written.
    """
    if isinstance(image, PillowImage.Image):
        picture = image.convert("RGB")
    else:
        array = np.asarray(image)
        if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
            raise InvalidInputError(
                "a picture must be a uint8 array of shape (H, W, 3); "
                f"got {array.dtype} {array.shape}"
            )
        picture = PillowImage.fromarray(array)
    with replace_when_done(Path(path), overwrite=overwrite) as temporary:
        picture.save(temporary, format="PNG", optimize=True)
