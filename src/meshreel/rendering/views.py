"""Viewing directions and the up axis."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.model.extent import Extent
from meshreel.rendering.camera import Camera, fit_camera

NAMED_VIEWS = {"front": (0.0, 0.0), "side": (90.0, 0.0), "top": (0.0, 90.0)}
"""Azimuth and elevation in degrees."""

ON_THE_FLOOR = 0.05
"""A mesh is on the floor if its lowest point is this close, relative to its height."""

Frames = Iterable[npt.NDArray[np.floating]]


@dataclass(frozen=True)
class View:
    """A viewing direction."""

    up: str = "y"
    """{"y", "z", "x"}. The axis that points up in the picture."""
    azimuth_deg: float = 30.0
    elevation_deg: float = 12.0
    """As in `meshreel.rendering.camera.fit_camera`."""

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
        projected = (camera.project(frame)[0] for frame in frames)
        boxes = np.array([(points.min(axis=0), points.max(axis=0)) for points in projected])
        width, height = np.maximum(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0), 1.0)
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
    """Guess the up axis: "z" for a mesh that rises from z = 0 and not from y = 0, else "y"."""
    height = extent.high - extent.low
    rises = (height > 0) & (np.abs(extent.low) <= ON_THE_FLOOR * height)
    return "z" if rises[2] and not rises[1] else "y"
