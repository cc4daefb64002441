"""A mesh of a stage that is being written: its faces once, its points frame by frame."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.extras import USD
from meshreel.formats.scenes.parts import PartMesh


class MeshWriter:
    """A mesh at a path of a stage, whose faces are written and whose points are to come.

    Parameters
    ----------
    stage : Usd.Stage
    path : str
    part : PartMesh
    """

    def __init__(self, stage: Any, path: str, part: PartMesh) -> None:
        geometry, arrays = USD.load("UsdGeom"), USD.load("Vt")
        _define_above(stage, path)
        mesh = geometry.Mesh.Define(stage, path)
        mesh.CreateFaceVertexCountsAttr(arrays.IntArray.FromNumpy(part.counts))
        mesh.CreateFaceVertexIndicesAttr(arrays.IntArray.FromNumpy(part.corners))
        mesh.CreateSubdivisionSchemeAttr(geometry.Tokens.none)
        self.prim = mesh.GetPrim()
        self._points, self._extent = mesh.CreatePointsAttr(), mesh.CreateExtentAttr()
        self._verts, self._array = part.verts, arrays.Vec3fArray

    def write_points(self, frame: npt.NDArray[np.float32], code: float | None) -> None:
        """Add the points of a frame, of shape (V, 3), and their extent.

        Parameters
        ----------
        frame : float32 array
            All vertices; those of this mesh are picked out.
        code : float or None
            The time code; None for points that are the same at all times.
        """
        points = np.ascontiguousarray(frame[self._verts])
        extent = np.stack([points.min(axis=0), points.max(axis=0)])
        when = USD.load("Usd").TimeCode.Default() if code is None else code
        self._points.Set(self._array.FromNumpy(points), when)
        self._extent.Set(self._array.FromNumpy(extent), when)


def _define_above(stage: Any, path: str) -> None:
    """Make prims of no geometry of those above a path that are not there yet."""
    steps = path.split("/")[1:-1]
    for n_steps in range(1, len(steps) + 1):
        above = "/" + "/".join(steps[:n_steps])
        if not stage.GetPrimAtPath(above):
            USD.load("UsdGeom").Xform.Define(stage, above)
