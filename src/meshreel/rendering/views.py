"""From where a mesh is seen: directions by name, which way is up, and a camera that circles."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import Extent
from meshreel.rendering.camera import Camera, fit_camera

NAMED_VIEWS = {"front": (0.0, 0.0), "side": (90.0, 0.0), "top": (0.0, 90.0)}
"""Azimuth and elevation in degrees."""

ON_THE_FLOOR = 0.05
"""A mesh stands on the floor if its lowest point is this near to it, in heights of the mesh."""

_N_RINGS, _N_ANGLES = 64, 72
_AXES = {"x": 0, "y": 1, "z": 2}

Frames = Iterable[npt.NDArray[np.floating]]


@dataclass(frozen=True)
class View:
    """A direction to look from.

    Parameters
    ----------
    up : {"y", "z", "x"}
        The axis that points up in the picture.
    azimuth_deg, elevation_deg : float
        As in `meshreel.rendering.camera.fit_camera`.
    """

    up: str = "y"
    azimuth_deg: float = 30.0
    elevation_deg: float = 12.0

    def camera(self, frames: Frames, width: int, height: int) -> Camera:
        """The nearest camera from there that sees every vertex of every frame.

        Parameters
        ----------
        frames : iterable of float arrays of shape (V, 3), in model units
        width, height : int
            Size of the picture, in pixels.
        """
        return fit_camera(
            frames,
            azimuth_deg=self.azimuth_deg, elevation_deg=self.elevation_deg,
            width=width, height=height, up=self.up,
        )  # fmt: skip

    def aspect(self, frames: Frames) -> float:
        """Width of what is seen from there over its height; 1 where it has neither."""
        camera = self.camera(frames, 512, 512)
        low, high = _bounds(camera.project(frame)[0] for frame in frames)
        width, height = np.maximum(high - low, 1.0)
        return float(width / height)


def parse_view(text: str, up: str) -> View:
    """The view that 'front', 'side', 'top' or 'AZIMUTH,ELEVATION' in degrees names.

    Raises
    ------
    InvalidInputError
        If it names none.
    """
    if text in NAMED_VIEWS:
        return View(up, *NAMED_VIEWS[text])
    try:
        azimuth_deg, elevation_deg = (float(part) for part in text.split(","))
    except ValueError:
        names = ", ".join(NAMED_VIEWS)
        raise InvalidInputError(
            f"a view is {names} or AZIMUTH,ELEVATION in degrees, such as 30,12; got {text!r}"
        ) from None
    return View(up, azimuth_deg, elevation_deg)


def guess_up(extent: Extent) -> str:
    """Which axis points up: "z" for what stands on the floor z = 0 and not on y = 0, else "y"."""
    height = np.maximum(extent.high - extent.low, np.finfo(np.float64).tiny)
    stands = np.abs(extent.low) <= ON_THE_FLOOR * height
    return "z" if stands[2] and not stands[1] else "y"


@dataclass(frozen=True, eq=False)
class Turntable:
    """Cameras on a circle about the upright line through the middle of a motion.

    Parameters
    ----------
    start : Camera
        It sees all of the motion from every angle of the circle.
    up : int
        Number of the axis that points up.
    centre : float64 array of shape (3,)
    """

    start: Camera
    up: int
    centre: Floats

    def camera(self, angle_deg: float) -> Camera:
        """The camera after so many degrees, to its own right."""
        turn = _rotation(self.up, np.radians(angle_deg))
        eye = self.centre + turn @ (self.start.eye - self.centre)
        return replace(self.start, eye=eye, axes=self.start.axes @ turn.T)


def turntable(view: View, swept: Floats, width: int, height: int) -> Turntable:
    """The turntable that begins with a view.

    Parameters
    ----------
    swept : float64 array of shape (N, 3)
        From `swept_points`, for the same axis up.
    width, height : int
        Size of the picture, in pixels.
    """
    low, high = _bounds([swept])
    return Turntable(view.camera([swept], width, height), _AXES[view.up], (low + high) / 2)


def swept_points(frames: Frames, up: str) -> Floats:
    """Points about all that vertices sweep as they turn about an upright line, of shape (N, 3).

    They are rings about the middle of the motion, each as wide as the widest vertex between it
    and the next.

    Parameters
    ----------
    frames : iterable of float arrays of shape (V, 3), in model units
        Gone through twice.
    up : {"y", "z", "x"}
    """
    axis = _AXES[up]
    low, high = _bounds(frames)
    centre, across = (low + high) / 2, [other for other in range(3) if other != axis]
    edges = np.linspace(low[axis], high[axis], _N_RINGS + 1)
    widest = np.zeros(_N_RINGS)
    for frame in frames:
        radii = np.sqrt(((frame - centre)[:, across] ** 2).sum(axis=1))
        rings = np.searchsorted(edges, frame[:, axis], side="right") - 1
        np.maximum.at(widest, np.clip(rings, 0, _N_RINGS - 1), radii)
    # The corners of the rings are a little outside, so that their sides are not inside.
    radius = widest[:, None] / np.cos(np.pi / _N_ANGLES)
    angles = np.arange(_N_ANGLES) * (2 * np.pi / _N_ANGLES)
    points = np.empty((2, _N_RINGS, _N_ANGLES, 3))
    points[..., axis] = np.stack([edges[:-1], edges[1:]])[:, :, None]
    points[..., across[0]] = centre[across[0]] + radius * np.cos(angles)
    points[..., across[1]] = centre[across[1]] + radius * np.sin(angles)
    return points.reshape(-1, 3)


def _bounds(frames: Iterable[npt.NDArray[np.floating]]) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates of all frames."""
    boxes = [(frame.min(axis=0), frame.max(axis=0)) for frame in frames]
    lows, highs = (np.array(side, np.float64) for side in zip(*boxes, strict=True))
    return lows.min(axis=0), highs.max(axis=0)


def _rotation(axis: int, angle_rad: float) -> Floats:
    """The matrix that turns about an axis, right-handed."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = np.cos(angle_rad)
    matrix[second, first], matrix[first, second] = np.sin(angle_rad), -np.sin(angle_rad)
    return matrix
