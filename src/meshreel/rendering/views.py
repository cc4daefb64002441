"""Viewing directions, the up axis, and a circling camera."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError
from meshreel.model.extent import Extent
from meshreel.rendering.camera import Camera, fit_camera

NAMED_VIEWS = {"front": (0.0, 0.0), "side": (90.0, 0.0), "top": (0.0, 90.0)}
"""Azimuth and elevation in degrees."""

ON_THE_FLOOR = 0.05
"""A mesh is on the floor if its lowest point is this close, relative to its height."""

_N_RINGS, _N_ANGLES = 64, 72
_AXES = {"x": 0, "y": 1, "z": 2}

Frames = Iterable[npt.NDArray[np.floating]]


@dataclass(frozen=True)
class View:
    """A viewing direction.

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
        """Return the nearest camera in this direction that sees every vertex of every frame.

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
        """Aspect ratio, width over height, of the projected mesh; 1 for a point."""
        camera = self.camera(frames, 512, 512)
        low, high = _bounds(camera.project(frame)[0] for frame in frames)
        width, height = np.maximum(high - low, 1.0)
        return float(width / height)


def parse_view(text: str, up: str) -> View:
    """Parse 'front', 'side', 'top' or 'AZIMUTH,ELEVATION' in degrees.

    Raises
    ------
    InvalidInputError
        If the text is neither.
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
    """Guess the up axis: "z" for a mesh on the floor z = 0 and not on y = 0, else "y"."""
    height = np.maximum(extent.high - extent.low, np.finfo(np.float64).tiny)
    is_on_floor = np.abs(extent.low) <= ON_THE_FLOOR * height
    return "z" if is_on_floor[2] and not is_on_floor[1] else "y"


@dataclass(frozen=True, eq=False)
class Turntable:
    """Cameras on a circle around the vertical axis through the center of a motion.

    Parameters
    ----------
    start : Camera
        Sees the whole motion from every angle of the circle.
    up : int
        Index of the up axis.
    center : float64 array of shape (3,)
    """

    start: Camera
    up: int
    center: Floats

    def camera(self, angle_deg: float) -> Camera:
        """The camera after a turn by this angle to its right."""
        turn = _rotation(self.up, np.radians(angle_deg))
        eye = self.center + turn @ (self.start.eye - self.center)
        return replace(self.start, eye=eye, axes=self.start.axes @ turn.T)


def turntable(view: View, swept: Floats, width: int, height: int) -> Turntable:
    """Return the turntable that starts at a view.

    Parameters
    ----------
    swept : float64 array of shape (N, 3)
        From `swept_points` with the same up axis.
    width, height : int
        Size of the picture, in pixels.
    """
    low, high = _bounds([swept])
    return Turntable(view.camera([swept], width, height), _AXES[view.up], (low + high) / 2)


def swept_points(frames: Frames, up: str) -> Floats:
    """Points around the volume that the motion sweeps when turned about the up axis, shape (N, 3).

    They form rings around the vertical axis through the center of the motion; the radius of each
    ring encloses all vertices up to the next.

    Parameters
    ----------
    frames : iterable of float arrays of shape (V, 3), in model units
        Iterated twice.
    up : {"y", "z", "x"}
    """
    axis = _AXES[up]
    low, high = _bounds(frames)
    center, across = (low + high) / 2, [other for other in range(3) if other != axis]
    edges = np.linspace(low[axis], high[axis], _N_RINGS + 1)
    widest = np.zeros(_N_RINGS)
    for frame in frames:
        radii = np.sqrt(((frame - center)[:, across] ** 2).sum(axis=1))
        rings = np.searchsorted(edges, frame[:, axis], side="right") - 1
        np.maximum.at(widest, np.clip(rings, 0, _N_RINGS - 1), radii)
    # Circumscribed polygons, so that no vertex is outside.
    radius = widest[:, None] / np.cos(np.pi / _N_ANGLES)
    angles = np.arange(_N_ANGLES) * (2 * np.pi / _N_ANGLES)
    points = np.empty((2, _N_RINGS, _N_ANGLES, 3))
    points[..., axis] = np.stack([edges[:-1], edges[1:]])[:, :, None]
    points[..., across[0]] = center[across[0]] + radius * np.cos(angles)
    points[..., across[1]] = center[across[1]] + radius * np.sin(angles)
    return points.reshape(-1, 3)


def _bounds(frames: Iterable[npt.NDArray[np.floating]]) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates of all frames."""
    boxes = [(frame.min(axis=0), frame.max(axis=0)) for frame in frames]
    lows, highs = (np.array(side, np.float64) for side in zip(*boxes, strict=True))
    return lows.min(axis=0), highs.max(axis=0)


def _rotation(axis: int, angle_rad: float) -> Floats:
    """The right-handed rotation matrix about a coordinate axis."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = np.cos(angle_rad)
    matrix[second, first], matrix[first, second] = np.sin(angle_rad), -np.sin(angle_rad)
    return matrix
