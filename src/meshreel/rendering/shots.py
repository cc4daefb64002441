"""Draw shots, which are frames of a scene seen by static or following cameras, on all cores."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshreel.arrays import Floats
from meshreel.model.frame_choice import spread_frames
from meshreel.rendering.camera import Camera
from meshreel.rendering.painting import Image
from meshreel.rendering.scenes import NO_SCALES, Frame, Scales, Scene, SelectedFrames
from meshreel.rendering.sheets import Annotations, Bar
from meshreel.rendering.views import View
from meshreel.runtime.threads import in_threads, n_cores

Shot = tuple[int, Camera]
"""The number of a frame, and the camera that sees it."""

ASPECT_FRAMES = 16
"""Frames sampled to determine the aspect ratio of the content."""

MIN_DISTANCE_RATIO = 1.15
"""A camera follows the mesh by default if that brings it nearer by this factor."""

MAX_TRAVEL = 0.12
"""In a picture of several frames, a camera also follows a mesh whose mean vertex would travel by
more than this fraction of a view: otherwise meshes would be off-center."""

PROBE_PX = 512


def draw_shots(
    scene: Scene, shots: Sequence[Shot], scales: Scales = NO_SCALES
) -> Iterator[list[Image]]:
    """Yield the views of each shot in order, drawing one shot per core at a time.

    Parameters
    ----------
    scales : Scales, optional
        Needed if colors represent numbers.
    """
    batch_size = n_cores()
    for start in range(0, len(shots), batch_size):
        # Read in this thread, because some file readers are not thread-safe.
        batch = [
            (scene.read(number), camera) for number, camera in shots[start : start + batch_size]
        ]
        yield from in_threads(lambda shot: scene.draw(*shot, scales), batch)


def representative_frames(numbers: Sequence[int], max_frames: int) -> list[int]:
    """At most this many evenly spaced frames without the first, which often shows the rest pose."""
    return spread_frames(numbers, max_frames + 1)[-max_frames:]


def frame_labels(scene: Scene, number: int) -> list[str]:
    """Labels of the views of a frame: its number and, if known, its time below the first."""
    timing = scene.sequence.timing
    digits = ".2f" if timing.times is None else ".4g"
    time = f", {timing.at(number):{digits}} s" if timing.fps else ""
    return [f"frame {number}{time}", *[""] * (len(scene.titles) - 1)]


def scene_annotations(
    scene: Scene, scales: Scales, labels: Sequence[str] = (), caption: str = ""
) -> Annotations:
    """Titles, labels, caption and color bars of a scene."""
    titles, widest = tuple(scene.titles), max(labels, key=len, default="")
    bars, lines = [], [caption] if caption else []
    if scene.track is not None and scales.track is not None:
        track, scale = scene.track, scales.track
        bars.append(Bar(scale.low, scale.high, track.unit, scene.track_column, track.colormap))
        lines.append(track.caption(scale))
    if scales.heat is not None:
        high, largest, unit = scales.heat.high, scales.heat.largest, scene.heat_unit
        bars.append(Bar(0.0, high, unit))
        noun, yellow = "value", "Yellow"
        if scene.track is not None:
            noun, yellow = "error", "Yellow errors"
        above = f"{yellow}: {_number(high, unit)} and more. " if largest > high else ""
        peak = f"The largest {noun} shown is {_number(largest, unit)}, in frame"
        lines.append(f"{above}{peak} {scales.heat.frame}.")
    return Annotations(titles, "\n".join(lines), widest, tuple(bars))


def _number(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".strip()


@dataclass(frozen=True, eq=False)
class _Centered:
    """Frames translated so that their center is the origin."""

    frames: SelectedFrames

    def __iter__(self) -> Iterator[Frame]:
        return (frame - center for frame, center in self.frames.with_centers())


@dataclass(frozen=True)
class Framing:
    """A view, and whether the camera follows the center of the mesh."""

    view: View
    is_followed: bool = False

    def aspect(self, frames: SelectedFrames) -> float:
        """Aspect ratio, width over height, of the visible mesh."""
        return self.view.aspect(_Centered(frames) if self.is_followed else frames)

    def cameras(self, frames: SelectedFrames, width: int, height: int) -> Sequence[Camera]:
        """Return a camera for each frame, as near as possible with every vertex in view.

        Parameters
        ----------
        width, height : int
            Size of the picture, in pixels.
        """
        if not self.is_followed:
            return [self.view.camera(frames, width, height)] * len(frames.numbers)
        near = self.view.camera(_Centered(frames), width, height)
        return [replace(near, eye=near.eye + center) for _, center in frames.with_centers()]


def framing_of(
    view: View,
    frames: SelectedFrames,
    *,
    is_followed: bool | None = None,
    max_travel: float = np.inf,
) -> Framing:
    """Decide whether the camera follows the mesh.

    Parameters
    ----------
    frames : ChosenFrames
        A representative sample.
    is_followed : bool, optional
        Default: if the mesh travels, and would otherwise be small or exceed ``max_travel``.
    max_travel : float, optional
        Longest path of the mean vertex without following, as a fraction of a view.
    """
    if is_followed is None:
        centers = np.array([center for _, center in frames.with_centers()])
        static, near = (
            view.camera(points, PROBE_PX, PROBE_PX) for points in (frames, _Centered(frames))
        )
        near_distance = _distance(near, np.zeros((1, 3)))
        travel_px = np.ptp(static.project(centers)[0], axis=0).max()
        is_followed = bool(
            _distance(static, centers) > MIN_DISTANCE_RATIO * near_distance
            or travel_px > max_travel * PROBE_PX
        )
    return Framing(view, is_followed)


def _distance(camera: Camera, centers: Floats) -> float:
    """Mean distance of the mesh from the camera along the viewing direction."""
    return float(((centers - camera.eye) @ camera.axes[2]).mean())
