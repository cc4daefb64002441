"""Shots: frames of a scene through cameras, drawn on all cores, and the sheet they stand on."""

from collections.abc import Iterator, Sequence

import numpy as np

from meshreel.rendering.camera import Camera
from meshreel.rendering.painting import Image
from meshreel.rendering.scenes import NO_SCALES, Moment, Scales, Scene
from meshreel.rendering.sheets import Bar, Words
from meshreel.runtime.threads import in_threads, n_cores, one_blas_thread

Shot = tuple[int, Camera]
"""The number of a frame, and the camera that sees it."""

ASPECT_FRAMES = 16
"""So many frames tell the shape of what is shown."""


def draw_shots(
    scene: Scene, shots: Sequence[Shot], scales: Scales = NO_SCALES
) -> Iterator[list[Image]]:
    """The views of each shot in order; as many shots are drawn at once as there are cores.

    Parameters
    ----------
    shots : sequence of Shot
    scales : Scales, optional
        Needed where colours stand for numbers.
    """
    together = n_cores()
    for start in range(0, len(shots), together):
        # Read here: not every file can be read by several threads.
        some = [(scene.read(number), camera) for number, camera in shots[start : start + together]]
        yield from _draw_at_once(scene, some, scales)


def _draw_at_once(
    scene: Scene, some: Sequence[tuple[Moment, Camera]], scales: Scales
) -> list[list[Image]]:
    drawn: list[list[Image]] = [[] for _ in some]

    def draw(place: int) -> None:
        drawn[place] = scene.draw(*some[place], scales)

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
    scene: Scene, scales: Scales, labels: Sequence[str] = (), caption: str = ""
) -> Words:
    """The words about a scene: titles, the ends of its colours, labels and a caption."""
    titles, widest = tuple(scene.titles), max(labels, key=len, default="")
    bars, lines = [], [caption] if caption else []
    if scene.track is not None and scales.track is not None:
        track, scale = scene.track, scales.track
        bar = Bar(scale.low, scale.high, track.unit, scene.track_column, track.colormap)
        bars.append(bar)
        lines.append(track.caption(scale))
    if scales.heat is not None:
        high, largest, unit = scales.heat.high, scales.heat.largest, scene.heat_unit
        bars.append(Bar(0.0, high, unit))
        what, yellow = "value", "Yellow"
        if scene.track is not None:
            what, yellow = "error", "Yellow errors"
        above = f"{yellow}: {_number(high, unit)} and more. " if largest > high else ""
        most = f"The largest {what} shown is {_number(largest, unit)}, in frame"
        lines.append(f"{above}{most} {scales.heat.frame}.")
    return Words(titles, "\n".join(lines), widest, tuple(bars))


def _number(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".strip()
