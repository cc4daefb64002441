"""Matrices from prims to the world or to a prototype, at any time code."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.model.sequence import Vertices
from meshreel.runtime.extras import USD

Matrix = npt.NDArray[np.float64]


class Transforms:
    """Transforms of the prims of a stage, cached per time code.

    Parameters
    ----------
    root : Usd.Prim, optional
        Transform prims below it to its space; default: to the world.
    """

    def __init__(self, root: Any = None) -> None:
        self._root = root
        self._geometry = USD.load("UsdGeom")
        self._cache = self._geometry.XformCache()
        self._codes: dict[str, list[float]] = {}

    def codes(self, prim: Any) -> list[float]:
        """Return the time codes where transforms of a prim or its ancestors have samples."""
        if not prim or prim.IsPseudoRoot() or (self._root and prim == self._root):
            return []
        path = str(prim.GetPath())
        if path not in self._codes:
            self._codes[path] = self._codes_of(prim)
        return self._codes[path]

    def world(self, prim: Any, code: float) -> Matrix:
        """Return the matrix from the prim to the world, of shape (4, 4), for row vectors.

        Raises
        ------
        FormatError
            If the prim is not below the root.
        """
        self._cache.SetTime(code)
        if self._root:
            if not prim.GetPath().HasPrefix(self._root.GetPath()):
                raise FormatError(
                    f"{prim.GetPath()} moves a mesh of the prototype {self._root.GetPath()} but is "
                    "not below it; move it there"
                )
            relative, _ = self._cache.ComputeRelativeTransform(prim, self._root)
            return np.array(relative, np.float64)
        return np.array(self._cache.GetLocalToWorldTransform(prim), np.float64)

    @staticmethod
    def own_codes(prim: Any) -> list[float]:
        """Return the time codes where the transform of a prim alone has samples."""
        xformable = USD.load("UsdGeom").Xformable(prim)
        operations = xformable.GetOrderedXformOps() if xformable else []
        return [code for one in operations for code in attribute_codes(one.GetAttr())]

    def _codes_of(self, prim: Any) -> list[float]:
        own = self.own_codes(prim)
        xformable = self._geometry.Xformable(prim)
        if xformable and xformable.GetResetXformStack():
            return own
        return own + self.codes(prim.GetParent())


def transform_points(points: Vertices, matrix: Matrix) -> Vertices:
    """Return transformed points of shape (V, 3), in their own float type if that is enough.

    They are computed in float64 and rounded once. The result stays float64 if it is so far from
    the origin that rounding would move a vertex by more than a millionth of the mesh size.
    """
    if np.array_equal(matrix, np.eye(4)):
        return points
    return transform_instances(points, matrix[np.newaxis])


def transform_instances(points: Vertices, matrices: Matrix) -> Vertices:
    """Return points of shape (V, 3) transformed by each of (I, 4, 4) matrices, as (I * V, 3).

    The float type is that of `transform_points`.
    """
    with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
        moved = points.astype(np.float64) @ matrices[:, :3, :3] + matrices[:, np.newaxis, 3, :3]
        world: Vertices = moved.reshape(-1, 3)
        narrowing = Narrowing()
        narrowing.add(world)
        dtype: Any = points.dtype if narrowing.is_harmless else np.float64
        vertices: Vertices = world.astype(dtype)
    return vertices


def is_mirroring(matrix: Matrix) -> bool:
    """Return whether a transform reverses orientation."""
    with np.errstate(all="ignore"):
        return bool(np.linalg.det(matrix[:3, :3]) < 0)
