"""Shots: frames of a scene through cameras, drawn on all cores, and the sheet they stand on."""

from collections.abc import Iterator, Sequence

import numpy as np

from meshreel.metrics.heat import HEATS
from meshreel.rendering.camera import Camera
from meshreel.rendering.painting import Image
from meshreel.rendering.scenes import Frame, HeatRange, Scene
from meshreel.rendering.sheets import Words
from meshreel.runtime.threads import in_threads, n_cores, one_blas_thread

Shot = tuple[int, Camera]
"""The number of a frame, and the camera that sees it."""

ASPECT_FRAMES = 16
"""So many frames tell the shape of what is shown."""


def draw_shots(
    scene: Scene, shots: Sequence[Shot], heat_range: HeatRange | None = None
) -> Iterator[list[Image]]:
    """The views of each shot in order; as many shots are drawn at once as there are cores.

    Parameters
    ----------
    scene : Scene
    shots : sequence of Shot
    heat_range : HeatRange, optional
        Needed where the scene has a heat map.
    """
    together = n_cores()
    for start in range(0, len(shots), together):
        # Read here: not every file can be read by several threads.
        some = [(scene.read(number), camera) for number, camera in shots[start : start + together]]
        yield from _draw_at_once(scene, some, heat_range)


def _draw_at_once(
    scene: Scene, some: Sequence[tuple[list[Frame], Camera]], heat_range: HeatRange | None
) -> list[list[Image]]:
    drawn: list[list[Image]] = [[] for _ in some]

    def draw(place: int) -> None:
        drawn[place] = scene.draw(*some[place], heat_range)

    with one_blas_thread():
        in_threads(draw, range(len(some)))
    return drawn


def spread_frames(numbers: Sequence[int], n_most: int) -> list[int]:
    """At most so many of the frames, evenly spaced from the first to the last."""
    places = np.linspace(0, len(numbers) - 1, min(n_most, len(numbers))).round().astype(int)
    return [numbers[place] for place in places]


def telling_frames(numbers: Sequence[int], n_most: int) -> list[int]:
    """At most so many of the frames, evenly spaced from after the first, often at rest, on."""
    return spread_frames(numbers, n_most + 1)[-n_most:]


def frame_labels(scene: Scene, number: int) -> list[str]:
    """The labels below each view of a frame: its number, and its time where that is known."""
    fps = scene.shown.fps
    time = f", {scene.shown.start_s + number / fps:.2f} s" if fps else ""
    return [f"frame {number}{time}", *[""] * (len(scene.titles) - 1)]


def scene_words(
    scene: Scene, heat_range: HeatRange | None, labels: Sequence[str] = (), caption: str = ""
) -> Words:
    """The words about a scene: titles, the ends of its colours, labels and a caption."""
    titles, widest = tuple(scene.titles), max(labels, key=len, default="")
    if heat_range is None or scene.heat is None:
        return Words(titles, caption, widest)
    unit = HEATS[scene.heat].unit
    high, largest = heat_range.high, heat_range.largest
    above = f"Yellow: {_number(high, unit)} and more. " if largest > high else ""
    most = f"The largest value shown is {_number(largest, unit)}, in frame {heat_range.frame}."
    caption = f"{caption}\n{above}{most}" if caption else above + most
    return Words(titles, caption, widest, high, unit)


def _number(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".strip()
