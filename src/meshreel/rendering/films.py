"""Films of selected frames, with a static, following or circling camera."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from PIL import Image as PillowImage

from meshreel.rendering.layout import Size
from meshreel.rendering.scenes import ChosenFrames, Scales, Scene
from meshreel.rendering.sheets import Sheet, plan_sheet
from meshreel.rendering.shots import (
    ASPECT_FRAMES,
    Shot,
    draw_shots,
    frame_labels,
    framing_of,
    scene_words,
    spread_frames,
)
from meshreel.rendering.views import View, swept_points, turntable
from meshreel.runtime.progress import Progress, silent

FILM_PX, GIF_PX = (1280, 720), (800, 450)
"""Largest picture by default; large GIFs would be huge files."""

UNKNOWN_FPS = 24.0
"""Frame rate of films of sequences whose own is unknown."""


@dataclass(frozen=True, eq=False)
class Film:
    """A film whose pictures are drawn during iteration.

    Attributes
    ----------
    shots : sequence of Shot
        One for each picture.
    fps : float
        Pictures per second.
    """

    scene: Scene
    scales: Scales
    sheet: Sheet
    shots: Sequence[Shot]
    fps: float

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
    turn_s: float | None = None,
    size: Size | None = None,
    max_size: Size = FILM_PX,
    is_followed: bool | None = None,
    progress: Progress = silent,
) -> Film:
    """Prepare a film of selected frames at their frame rate.

    Parameters
    ----------
    scene : Scene
        Plays at `UNKNOWN_FPS` if its frame rate is unknown.
    numbers : sequence of int
        Frame numbers, at least one.
    turn_s : float, optional
        Seconds per turn of a circling camera. The film lasts for the frames, repeated, or for one
        turn, whichever is longer. Default: the camera does not circle.
    size : tuple of 2 ints, optional
        Width and height in pixels. Default: fits the content.
    max_size : tuple of 2 ints
        Limit of the default size.
    is_followed : bool, optional
        Whether a camera that does not circle follows the mesh. Default: if the mesh would
        otherwise be small.
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
    words = scene_words(scene, scales, labels)
    frames = ChosenFrames(scene.framed, numbers)
    if turn_s is None:
        sample = ChosenFrames(scene.framed, spread_frames(numbers, ASPECT_FRAMES))
        framing = framing_of(view, sample, is_followed=is_followed)
        layout = plan_sheet(words, len(words.titles), framing.aspect(sample), size, max_size)
        shots = list(zip(numbers, framing.cameras(frames, *layout.view_size), strict=True))
    else:
        swept = swept_points(frames, view.up)
        layout = plan_sheet(words, len(words.titles), view.aspect([swept]), size, max_size)
        circle, n_per_turn = turntable(view, swept, *layout.view_size), max(1, round(turn_s * fps))
        cameras = [circle.camera(360 * step / n_per_turn) for step in range(n_per_turn)]
        shots = [
            (numbers[step % len(numbers)], cameras[step % n_per_turn])
            for step in range(max(len(numbers), n_per_turn))
        ]
    return Film(scene, scales, Sheet(layout, words, scene.background), shots, fps)
