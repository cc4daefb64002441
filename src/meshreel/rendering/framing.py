"""Static and following cameras for selected frames."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshreel.arrays import Floats
from meshreel.rendering.camera import Camera
from meshreel.rendering.scenes import ChosenFrames, Frame
from meshreel.rendering.views import View

MIN_DISTANCE_RATIO = 1.15
"""A camera follows the mesh by default if that brings it nearer by this factor."""

MAX_TRAVEL = 0.12
"""In a picture of several frames, a camera also follows a mesh whose mean vertex would travel by
more than this fraction of a view: otherwise meshes would be off-center."""

PROBE_PX = 512


@dataclass(frozen=True, eq=False)
class _Centered:
    """Frames translated so that their center is the origin."""

    frames: ChosenFrames

    def __iter__(self) -> Iterator[Frame]:
        return (frame - center for frame, center in self.frames.with_centers())


@dataclass(frozen=True)
class Framing:
    """A view, and whether the camera follows the center of the mesh."""

    view: View
    is_followed: bool = False

    def aspect(self, frames: ChosenFrames) -> float:
        """Aspect ratio, width over height, of the visible mesh."""
        return self.view.aspect(_Centered(frames) if self.is_followed else frames)

    def cameras(self, frames: ChosenFrames, width: int, height: int) -> Sequence[Camera]:
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
    frames: ChosenFrames,
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
