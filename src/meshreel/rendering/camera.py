"""A pinhole camera, fitted to frame a whole sequence."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import InvalidInputError

FIELD_OF_VIEW_DEG = 28.0
"""Across the shorter side of the picture; narrow enough for little perspective distortion."""

_UP_AND_RIGHT = {
    "x": ((1, 0, 0), (0, 1, 0)),
    "y": ((0, 1, 0), (1, 0, 0)),
    "z": ((0, 0, 1), (1, 0, 0)),
}


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with square pixels that looks along the third row of ``axes``.

    Raises
    ------
    InvalidInputError
        If the picture has no pixels, or the axes are not orthonormal.
    """

    eye: Floats
    """float array of shape (3,). Center of projection, in model units."""
    axes: Floats
    """float array of shape (3, 3). Unit rows: to the right of the picture, down the picture, into
    the scene.
    """
    focal_px: float
    """Distance of the image plane, in pixels."""
    width: int
    height: int
    """Size of the picture, in pixels."""

    def __post_init__(self) -> None:
        _check_size(self.width, self.height)
        if not np.allclose(self.axes @ self.axes.T, np.eye(3), atol=1e-6):
            raise InvalidInputError(f"camera axes must be orthonormal rows; got {self.axes}")

    def project(self, vertices: npt.NDArray[np.floating]) -> tuple[Floats, Floats]:
        """Picture coordinates and depths of points.

        Parameters
        ----------
        vertices : float array of shape (..., 3), in model units

        Returns
        -------
        points : float64 array of shape (..., 2)
            In pixels from the upper left corner, x to the right and y down; zero for points
            that are not in front of the camera.
        depths : float64 array of shape (...)
            Distance along the viewing direction, in model units; positive in front.
        """
        local = (vertices - self.eye) @ self.axes.T
        depths = local[..., 2]
        in_front = depths > 0
        px_per_unit = np.divide(self.focal_px, depths, out=np.zeros_like(depths), where=in_front)
        center = np.array([self.width, self.height]) / 2
        points = np.where(
            in_front[..., None], local[..., :2] * px_per_unit[..., None] + center, 0.0
        )
        return points, depths


def fit_camera(
    vertices: npt.NDArray[np.floating] | Iterable[npt.NDArray[np.floating]],
    *,
    azimuth_deg: float = 30.0,
    elevation_deg: float = 12.0,
    width: int = 800,
    height: int = 800,
    margin: float = 0.06,
    up: str = "y",
) -> Camera:
    """Return the nearest camera in a given direction that sees every vertex of every frame.

    Parameters
    ----------
    vertices : float array of shape (T, V, 3) or (V, 3), or iterable of arrays of shape (V, 3)
        Everything that must be in the picture, in model units; an iterable is read once.
    azimuth_deg : float
        0 looks at the front (from +z when y is up, from -y when z is up); positive angles move the
        camera to its right.
    elevation_deg : float
        In -90..90; the camera looks down from above when positive.
    width, height : int
        Size of the picture, in pixels.
    margin : float
        Border on every side, as a fraction of the shorter side; in 0..0.45.
    up : {"y", "z", "x"}
        The axis that points up in the picture.

    Raises
    ------
    InvalidInputError
        If a position is not finite, or an argument is out of its range.
    """
    if up not in _UP_AND_RIGHT:
        raise InvalidInputError(f"up must be 'x', 'y' or 'z'; got {up!r}")
    if not 0 <= margin <= 0.45:
        raise InvalidInputError(f"margin must be in 0..0.45; got {margin}")
    if not (np.isfinite(azimuth_deg) and -90 <= elevation_deg <= 90):
        raise InvalidInputError(
            f"azimuth must be finite and elevation in -90..90 degrees; "
            f"got {azimuth_deg} and {elevation_deg}"
        )
    _check_size(width, height)
    frames: Iterable[npt.NDArray[np.floating]] = vertices
    if isinstance(vertices, np.ndarray):
        if vertices.ndim not in (2, 3) or vertices.shape[-1] != 3 or vertices.size == 0:
            raise InvalidInputError(
                f"vertices must have shape (T, V, 3) or (V, 3); got {vertices.shape}"
            )
        frames = vertices[None] if vertices.ndim == 2 else vertices
    axes = _viewing_axes(np.radians(azimuth_deg), np.radians(elevation_deg), up)
    shorter_px = min(width, height)
    focal_px = 0.5 * shorter_px / np.tan(np.radians(FIELD_OF_VIEW_DEG / 2))
    slopes = (np.array([width, height]) / 2 - margin * shorter_px) / focal_px
    eye = _nearest_eye(frames, axes, slopes) @ axes
    return Camera(eye, axes, float(focal_px), width, height)


def _check_size(width: int, height: int) -> None:
    if width < 1 or height < 1:
        raise InvalidInputError(f"a picture needs at least 1 x 1 pixels; got {width} x {height}")


def _viewing_axes(azimuth_rad: float, elevation_rad: float, up: str) -> Floats:
    above, side = (np.array(axis, np.float64) for axis in _UP_AND_RIGHT[up])
    front = np.cross(side, above)
    right = np.cos(azimuth_rad) * side - np.sin(azimuth_rad) * front
    towards_eye = np.cos(azimuth_rad) * front + np.sin(azimuth_rad) * side
    towards_eye = np.cos(elevation_rad) * towards_eye + np.sin(elevation_rad) * above
    return np.stack([right, np.cross(right, towards_eye), -towards_eye])


def _nearest_eye(
    frames: Iterable[npt.NDArray[np.floating]], axes: Floats, slopes: Floats
) -> Floats:
    """The nearest eye, in camera axes, that keeps all points inside the view frustum.

    A point p is inside when ``|p_k - e_k| <= slope_k (p_z - e_z)`` for k = x, y: one maximum over
    all points bounds each side, and these maxima determine the eye.
    """
    reach = np.full((2, 2), -np.inf)
    nearest, farthest = np.inf, -np.inf
    for frame in frames:
        if not np.isfinite(frame).all():
            raise InvalidInputError("a camera needs finite positions; got NaN or infinity")
        local = frame @ axes.T
        across, depth = local[:, :2], local[:, 2:]
        upper, lower = across - slopes * depth, -across - slopes * depth
        reach = np.maximum(reach, np.stack([upper.max(axis=0), lower.max(axis=0)]))
        nearest, farthest = min(nearest, float(depth.min())), max(farthest, float(depth.max()))
    # No point may coincide with the eye, even if the whole model is one point.
    clearance = 0.05 * (farthest - nearest) or 1.0
    near = min(float((-reach.sum(axis=0) / (2 * slopes)).min()), nearest - clearance)
    return np.array([*(reach[0] - reach[1]) / 2, near])
