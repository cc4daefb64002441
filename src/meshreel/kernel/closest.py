"""Closest points of triangle meshes, by the core."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.kernel.library import call, int32s, memory

Indices = npt.NDArray[np.int64]


class Closest(NamedTuple):
    """The closest points of N points on a triangle mesh.

    Attributes
    ----------
    distances : float64 array of shape (N,)
        Infinite if no face is found.
    faces : int64 array of shape (N,)
        The face that contains each closest point, the lowest of equally close ones; -1 without one.
    points : float64 array of shape (N, 3)
    weights : float64 array of shape (N, 3)
        Barycentric coordinates of `points` in `faces`.
    """

    distances: Floats
    faces: Indices
    points: Floats
    weights: Floats

    def at(self, items: Indices) -> "Closest":
        """Return the closest points of the selected points."""
        return Closest(
            self.distances[items], self.faces[items], self.points[items], self.weights[items]
        )


class TriangleTree:
    """A tree of boxes over the faces of a mesh, for any number of searches, also in threads.

    Degenerate and repeated faces are allowed. Distances are exact up to the rounding of differences
    of coordinates, even far from the origin; for slivers, up to 1e-8 of their length. Results do
    not depend on the order of the points.

    Parameters
    ----------
    vertices : float64 array of shape (V, 3)
        All finite.
    faces : integer array of shape (M, 3)
        At least one.

    Raises
    ------
    InvalidInputError
        If there is no face, or one contains a vertex that does not exist.
    """

    def __init__(self, vertices: Floats, faces: npt.NDArray[np.integer]) -> None:
        self._n_faces = len(faces)
        self._tree = memory("reel_triangle_tree_bytes", self._n_faces)
        call(
            "reel_triangle_tree",
            np.ascontiguousarray(vertices, np.float64),
            len(vertices),
            int32s(faces),
            self._n_faces,
            self._tree,
            noun="faces",
            memory_of=("reel_triangle_tree_memory", self._n_faces),
        )

    def closest(
        self, points: Floats, directions: Floats | None = None, reach: float = np.inf
    ) -> Closest:
        """Return the closest point of the mesh for each point of shape (N, 3), finite.

        Parameters
        ----------
        directions : float64 array of shape (N, 3), optional
            A face is a candidate for a point only if its unit normal has a dot product of at least
            1 with the vector of the point.
        reach : float
            Maximum distance.
        """
        n_points = len(points)
        distances, faces = np.empty(n_points), np.empty(n_points, np.int32)
        closest, weights = np.empty((n_points, 3)), np.empty((n_points, 3))
        call(
            "reel_closest",
            self._tree,
            self._n_faces,
            np.ascontiguousarray(points, np.float64),
            None if directions is None else np.ascontiguousarray(directions, np.float64),
            float(reach),
            n_points,
            distances,
            faces,
            closest,
            weights,
            noun="points",
            memory_of=("reel_closest_memory", n_points),
        )
        return Closest(distances, faces.astype(np.int64), closest, weights)
