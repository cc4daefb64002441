"""Colours of vertices, faces or corners, as the rasterizer takes them."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.model.geometry.fans import fan_corners
from meshreel.model.sequence import Faces
from meshreel.model.surface import Domain, Surface


def colors_of_items(
    colors: npt.NDArray[Any], domain: Domain, surface: Surface, faces: Faces
) -> npt.NDArray[Any]:
    """Colours of vertices as they are, of shape (V, 3); those of others of each triangle's corners.

    Parameters
    ----------
    colors : array of shape (N, 3)
    domain : Domain
        What the N are; faces are polygons, corners are theirs.
    surface : Surface
        Has the polygons.
    faces : int32 array of shape (M, 3)

    Returns
    -------
    array of shape (V, 3) or (M, 3, 3)
    """
    if domain is Domain.VERTEX:
        return colors
    sizes = surface.sizes(len(faces))
    if domain is Domain.CORNER:
        return np.asarray(colors[fan_corners(sizes)])
    of_triangles = np.repeat(colors, sizes - 2, axis=0)
    return np.repeat(of_triangles[:, np.newaxis], 3, axis=1)
