"""Films of selected frames, with a static or following camera."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image as PillowImage

from meshreel.model.frame_choice import spread_frames
from meshreel.model.timing import DUE_TOLERANCE, Timing
from meshreel.rendering.layout import Size
from meshreel.rendering.scenes import Scales, Scene
from meshreel.rendering.sheets import Sheet, plan_sheet
from meshreel.rendering.shots import (
    ASPECT_FRAMES,
    Shot,
    draw_shots,
    frame_labels,
    framing_of,
    scene_annotations,
)
from meshreel.rendering.views import View
from meshreel.runtime.progress import Progress, silent

FILM_PX, GIF_PX = (1280, 720), (800, 450)
"""Largest picture by default; large GIFs would be huge files."""

UNKNOWN_FPS = 24.0
"""Frame rate of films of sequences whose own is unknown."""


@dataclass(frozen=True, eq=False)
class Film:
    """A film whose pictures are drawn during iteration."""

    scene: Scene
    scales: Scales
    sheet: Sheet
    shots: Sequence[Shot]
    """One for each picture."""
    fps: float
    """Pictures per second."""

    @property
    def n_pictures(self) -> int:
        """Number of pictures."""
        return len(self.shots)

    @property
    def size(self) -> Size:
        """Width and height of each picture, in pixels."""
        return self.sheet.layout.size

    def pictures(self, stride: int = 1) -> Iterator[PillowImage.Image]:
        """Yield every `stride`-th picture."""
        shots = self.shots[::stride]
        views_of_shots = draw_shots(self.scene, shots, self.scales)
        for (number, _), views in zip(shots, views_of_shots, strict=True):
            yield self.sheet.compose(views, frame_labels(self.scene, number))


def film(
    scene: Scene,
    numbers: Sequence[int],
    view: View,
    *,
    size: Size | None = None,
    max_size: Size = FILM_PX,
    is_followed: bool | None = None,
    progress: Progress = silent,
) -> Film:
    """Prepare a film of selected frames at their frame rate.

    Frames in order that are not evenly spaced are shown when they are due, at their mean rate.

    Parameters
    ----------
    scene : Scene
        Plays at `UNKNOWN_FPS` if its frame rate is unknown.
    numbers : sequence of int
        Frame numbers, at least one.
    size : tuple of 2 ints, optional
        Width and height in pixels. Default: fits the content.
    max_size : tuple of 2 ints
        Limit of the default size.
    is_followed : bool, optional
        Whether the camera follows the mesh. Default: if the mesh would otherwise be small.
    progress : Progress, default silent
        Called while the frames of a heat map are measured.

    Raises
    ------
    InvalidInputError
        If the size is too small.
    """
    fps = scene.sequence.fps or UNKNOWN_FPS
    scales = scene.scales(numbers, progress)
    labels = [frame_labels(scene, number)[0] for number in numbers]
    annotations = scene_annotations(scene, scales, labels)
    sample = scene.frames(spread_frames(numbers, ASPECT_FRAMES))
    framing = framing_of(view, sample, is_followed=is_followed)
    layout = plan_sheet(
        annotations, len(annotations.titles), framing.aspect(sample), size, max_size
    )
    cameras = framing.cameras(scene.frames(numbers), *layout.view_size)
    shots = list(zip(numbers, cameras, strict=True))
    times = scene.sequence.timing.times
    if times is not None and len(numbers) > 1 and (np.diff(numbers) > 0).all():
        timing = Timing.of_times(times[list(numbers)])
        fps = timing.fps or fps
        due_times_s = (timing.start_s + (np.arange(len(numbers)) + DUE_TOLERANCE) / fps).tolist()
        shots = [shots[timing.frame_at(time, len(shots))] for time in due_times_s]
    return Film(scene, scales, Sheet(layout, annotations, scene.background), shots, fps)
