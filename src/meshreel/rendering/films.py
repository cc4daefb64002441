"""Films: chosen frames picture by picture, through a camera that stands still or circles."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from PIL import Image as PillowImage

from meshreel.rendering.framing import framing_of
from meshreel.rendering.layout import Place
from meshreel.rendering.scenes import ChosenFrames, Scales, Scene
from meshreel.rendering.sheets import Sheet, plan_sheet
from meshreel.rendering.shots import (
    ASPECT_FRAMES,
    Shot,
    draw_shots,
    frame_labels,
    scene_words,
    spread_frames,
)
from meshreel.rendering.views import Turntable, View, swept_points, turntable
from meshreel.runtime.progress import Progress, silent

FILM_PX, GIF_PX = (1280, 720), (800, 450)
"""The largest picture when no size is given; a GIF has no room for large ones."""

UNKNOWN_FPS = 24.0
"""At which a sequence plays whose frame rate is not known."""


@dataclass(frozen=True, eq=False)
class Film:
    """Pictures that are drawn while they are gone through; none is kept.

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
        """How many pictures there are."""
        return len(self.shots)

    @property
    def size(self) -> Place:
        """Width and height of each picture, in pixels."""
        return self.sheet.layout.size

    def pictures(self, stride: int = 1) -> Iterator[PillowImage.Image]:
        """All pictures in order, or one of every `stride`."""
        shots = self.shots[::stride]
        drawn = draw_shots(self.scene, shots, self.scales)
        for (number, _), views in zip(shots, drawn, strict=True):
            yield self.sheet.filled(views, frame_labels(self.scene, number))


def film(
    scene: Scene,
    numbers: Sequence[int],
    view: View,
    *,
    turn_s: float | None = None,
    size: Place | None = None,
    most: Place = FILM_PX,
    is_followed: bool | None = None,
    progress: Progress = silent,
) -> Film:
    """A film of some frames at their frame rate.

    Parameters
    ----------
    scene : Scene
        It plays at `UNKNOWN_FPS` if its frame rate is not known.
    numbers : sequence of int
        Of frames, at least one.
    turn_s : float, optional
        Seconds in which the camera goes round once. The film lasts for the frames or for one
        turn, whichever is longer; frames begin again. Default: it does not circle.
    size : tuple of 2 ints, optional
        Width and height in pixels. Default: as suits what is shown.
    most : tuple of 2 ints
        The largest that it becomes by default.
    is_followed : bool, optional
        Whether a camera that does not circle goes along with the mesh. Default: where it would
        otherwise be small.
    progress : Progress, default silent
        Told while frames are measured for a heat map.

    Raises
    ------
    InvalidInputError
        If the size is too small.
    """
    fps = scene.shown.fps or UNKNOWN_FPS
    scales = scene.scales(numbers, progress)
    labels = [frame_labels(scene, number)[0] for number in numbers]
    words = scene_words(scene, scales, labels)
    frames = ChosenFrames(scene.framed, numbers)
    if turn_s is None:
        some = ChosenFrames(scene.framed, spread_frames(numbers, ASPECT_FRAMES))
        framing = framing_of(view, some, is_followed=is_followed)
        layout = plan_sheet(words, len(words.titles), framing.aspect(some), size, most)
        shots = list(zip(numbers, framing.cameras(frames, *layout.view_size), strict=True))
    else:
        swept = swept_points(frames, view.up)
        layout = plan_sheet(words, len(words.titles), view.aspect([swept]), size, most)
        circle = turntable(view, swept, *layout.view_size)
        shots = _circling(circle, numbers, max(1, round(turn_s * fps)))
    return Film(scene, scales, Sheet(layout, words, scene.background), shots, fps)


def _circling(circle: Turntable, numbers: Sequence[int], n_per_turn: int) -> list[Shot]:
    cameras = [circle.camera(360 * place / n_per_turn) for place in range(n_per_turn)]
    pictures = range(max(len(numbers), n_per_turn))
    return [(numbers[nth % len(numbers)], cameras[nth % n_per_turn]) for nth in pictures]
