"""Transforms from prims to the world, at any time code."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.extras import USD
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.sequence import Vertices

Matrix = npt.NDArray[np.float64]


class Transforms:
    """Transforms of the prims of a stage, each looked up once."""

    def __init__(self) -> None:
        self._geometry = USD.load("UsdGeom")
        self._cache = self._geometry.XformCache()
        self._codes: dict[str, list[float]] = {}

    def codes(self, prim: Any) -> list[float]:
        """Where transforms of a prim, or of those above it, have samples."""
        if not prim or prim.IsPseudoRoot():
            return []
        path = str(prim.GetPath())
        if path not in self._codes:
            self._codes[path] = self._codes_of(prim)
        return self._codes[path]

    def world(self, prim: Any, code: float) -> Matrix:
        """Of shape (4, 4), from the prim to the world; positions are rows on its left."""
        self._cache.SetTime(code)
        return np.array(self._cache.GetLocalToWorldTransform(prim), np.float64)

    def _codes_of(self, prim: Any) -> list[float]:
        own: list[float] = []
        if prim.IsA(self._geometry.Xformable):
            xformable = self._geometry.Xformable(prim)
            for operation in xformable.GetOrderedXformOps():
                own += attribute_codes(operation.GetAttr())
            if xformable.GetResetXformStack():
                return own
        return own + self.codes(prim.GetParent())


def placed(points: Vertices, matrix: Matrix) -> Vertices:
    """Positions of shape (V, 3) in world space, in their type unless that is not enough.

    They are computed in float64 and rounded once. Float32 stays float64 where a transform takes
    the model so far from the origin that rounding would move a vertex by more than a millionth of
    the model's size.
    """
    if np.array_equal(matrix, np.eye(4)):
        return points
    with np.errstate(all="ignore"):  # what is not finite is found where all frames are looked at
        world: Vertices = points.astype(np.float64) @ matrix[:3, :3] + matrix[3, :3]
        narrowing = Narrowing()
        narrowing.add(world)
        dtype: Any = points.dtype if narrowing.is_harmless else np.float64
        vertices: Vertices = world.astype(dtype)
    return vertices


def mirrors(matrix: Matrix) -> bool:
    """Whether a transform turns a surface inside out."""
    with np.errstate(all="ignore"):
        return bool(np.linalg.det(matrix[:3, :3]) < 0)
