"""Cameras for chosen frames: one that stands still, or one that goes along with the mesh."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshreel.arrays import Floats
from meshreel.rendering.camera import Camera
from meshreel.rendering.scenes import ChosenFrames, Frame
from meshreel.rendering.views import View

NEARER = 1.15
"""A camera goes along with a mesh that it comes so much nearer to by that."""


@dataclass(frozen=True, eq=False)
class _Centred:
    """Frames moved until their mean vertex is in the origin, made whenever gone through."""

    frames: ChosenFrames

    def __iter__(self) -> Iterator[Frame]:
        return (frame - _middle(frame) for frame in self.frames)


@dataclass(frozen=True)
class Framing:
    """From where frames are seen.

    Attributes
    ----------
    is_followed : bool
        Whether the camera goes along with the mean vertex of the mesh.
    """

    view: View
    is_followed: bool = False

    def aspect(self, frames: ChosenFrames) -> float:
        """Width of what is seen over its height."""
        return self.view.aspect(_Centred(frames) if self.is_followed else frames)

    def cameras(self, frames: ChosenFrames, width: int, height: int) -> Sequence[Camera]:
        """A camera for each frame, as near as every vertex of every frame allows.

        Parameters
        ----------
        width, height : int
            Size of the picture, in pixels.
        """
        if not self.is_followed:
            return [self.view.camera(frames, width, height)] * len(frames.numbers)
        near = self.view.camera(_Centred(frames), width, height)
        return [replace(near, eye=near.eye + _middle(frame)) for frame in frames]


def framing_of(view: View, frames: ChosenFrames, *, is_followed: bool | None = None) -> Framing:
    """The framing that shows the mesh of some frames large enough.

    Parameters
    ----------
    frames : ChosenFrames
        Some that stand for all.
    is_followed : bool, optional
        Default: where the mesh would otherwise be small, because it travels.
    """
    if is_followed is None:
        middles = np.array([_middle(frame) for frame in frames])
        still, near = (view.camera(some, 512, 512) for some in (frames, _Centred(frames)))
        is_followed = _distance(still, middles) > NEARER * _distance(near, np.zeros((1, 3)))
    return Framing(view, is_followed)


def _middle(frame: Frame) -> Floats:
    middle: Floats = frame.mean(axis=0, dtype=np.float64)
    return middle


def _distance(camera: Camera, middles: Floats) -> float:
    """How far the mesh is from the camera, in the mean of its frames."""
    return float(((middles - camera.eye) @ camera.axes[2]).mean())
