"""Points and faces of a mesh prim, without faces that are holes."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Attribute, Domain, FaceGroups, Surface
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import USD

INFINITELY_SHARP = 10.0
"""Sharpness from which USD does not smooth a crease."""

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MeshShape:
    """Points and faces of a mesh prim in local space, at any time code.

    Parameters
    ----------
    prim : Usd.Prim
    """

    prim: Any

    @property
    def stored(self) -> list[float]:
        """Time codes where points and faces have samples."""
        shape = (self._mesh.GetPointsAttr(), *self._face_attributes, self._holes)
        return [code for one in shape for code in attribute_codes(one)]

    @property
    def keys(self) -> list[float]:
        """Time codes of other animation, which a mesh does not have."""
        return []

    @cached_property
    def has_constant_topology(self) -> bool:
        """Whether its faces are the same at all times."""
        attributes = (*self._face_attributes, self._holes)
        return not any(one.ValueMightBeTimeVarying() for one in attributes)

    @property
    def is_left_handed(self) -> bool:
        """Whether its faces are clockwise."""
        left = USD.load("UsdGeom").Tokens.leftHanded
        return bool(self._mesh.GetOrientationAttr().Get() == left)

    def points(self, code: float) -> Vertices:
        """Return the points at a time code, of shape (V, 3).

        Raises
        ------
        FormatError
            If there are none, or they have another type.
        """
        points: Vertices = np.asarray(self._value(self._mesh.GetPointsAttr(), code))
        if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind != "f":
            raise FormatError(f"mesh {self._path} has points of a type other than point3f")
        return points if points.dtype.itemsize > 2 else points.astype(np.float32)

    def polygons(self, vertices: Vertices, code: float) -> PolygonMesh:
        """Return the validated faces at a time code, with these vertices.

        Raises
        ------
        FormatError
            If faces are missing or invalid.
        """
        counts, corners = (
            _integers(self._value(one, code), self._path) for one in self._face_attributes
        )
        if (counts < 0).any() or counts.sum(dtype=np.int64) != len(corners):
            raise FormatError(
                f"mesh {self._path} has {len(corners)} faceVertexIndices at time code {code:g}; "
                f"its faceVertexCounts need {counts.sum(dtype=np.int64)}"
            )
        if not len(vertices) or not len(counts):
            raise FormatError(
                f"mesh {self._path} has {counted(len(vertices), 'vertex')} and "
                f"{counted(len(counts), 'face')} at "
                f"time code {code:g}; a triangle mesh needs both"
            )
        return polygon_mesh(vertices, counts, corners, place=f"mesh {self._path}, face {{}}".format)

    def solid_faces(self, n_faces: int, code: float) -> Mask | None:
        """Return a mask of the faces that are not holes at a time code, or None without holes."""
        return solid_faces(self._holes.Get(code), n_faces, self._path)

    @property
    def is_subdivided(self) -> bool:
        """Whether it is the cage of a subdivision surface, which is the default in USD."""
        none = USD.load("UsdGeom").Tokens.none
        return bool(self._mesh.GetSubdivisionSchemeAttr().Get() != none)

    def sharp_edges(self, code: float) -> npt.NDArray[np.int64] | None:
        """Return the infinitely sharp creases of a subdivision surface, of shape (N, 2), or None.

        Invalid creases are ignored.
        """
        mesh = self._mesh
        attributes = (mesh.GetCreaseIndicesAttr(), mesh.GetCreaseLengthsAttr())
        indices, lengths = (np.asarray(one.Get(code) or [], np.int64) for one in attributes)
        sharpness = np.asarray(mesh.GetCreaseSharpnessesAttr().Get(code) or [], np.float64)
        if not self.is_subdivided or (lengths < 2).any() or lengths.sum() != len(indices):
            return None
        if len(sharpness) == len(lengths):  # one per crease, otherwise one per edge
            sharpness = np.repeat(sharpness, lengths - 1)
        if not len(indices) or len(sharpness) != len(indices) - len(lengths):
            return None
        is_last = np.zeros(len(indices), bool)
        is_last[np.cumsum(lengths) - 1] = True
        edges = np.stack([indices[:-1], indices[1:]], axis=1)[~is_last[:-1]]
        return edges[sharpness >= INFINITELY_SHARP]

    @cached_property
    def _mesh(self) -> Any:
        return USD.load("UsdGeom").Mesh(self.prim)

    @property
    def _path(self) -> str:
        return str(self.prim.GetPath())

    @property
    def _holes(self) -> Any:
        return self._mesh.GetHoleIndicesAttr()

    @property
    def _face_attributes(self) -> tuple[Any, Any]:
        return self._mesh.GetFaceVertexCountsAttr(), self._mesh.GetFaceVertexIndicesAttr()

    def _value(self, attribute: Any, code: float) -> Any:
        value = attribute.Get(code)
        if value is None:
            raise FormatError(
                f"mesh {self._path} has no {attribute.GetName()} at time code {code:g}"
            )
        return value


def _integers(value: Any, path: str) -> npt.NDArray[np.int32]:
    array = np.asarray(value)
    if array.ndim != 1 or (array.size and array.dtype != np.int32):
        raise FormatError(f"mesh {path} has faces of a type other than int[]")
    return array.astype(np.int32, copy=False)


def solid_faces(holes: Any, n_faces: int, path: str) -> Mask | None:
    """Return a mask of the faces that are not holes, or None without holes.

    Parameters
    ----------
    holes : array of int or None
        Indices of faces that are holes; indices out of range are ignored.
    path : str
        Path of the mesh.

    Raises
    ------
    FormatError
        If all faces are holes.
    """
    numbers = np.asarray([] if holes is None else holes)
    numbers = numbers[(numbers >= 0) & (numbers < n_faces)]
    if not len(numbers):
        return None
    solid = np.ones(n_faces, bool)
    solid[numbers] = False
    if not solid.any():
        raise FormatError(f"mesh {path} has {n_faces} faces, and all of them are holes")
    return solid


def select_faces(mesh: PolygonMesh, solid: Mask) -> PolygonMesh:
    """Return the mesh with the selected faces and all of its vertices."""
    counts = mesh.counts[solid]
    return PolygonMesh(mesh.vertices, counts, mesh.corners[np.repeat(solid, mesh.counts)])


def select_surface(surface: Surface, solid: Mask, counts: npt.NDArray[np.int64]) -> Surface:
    """Return the surface of the selected faces; `counts` are the corners of all faces."""
    kept = {Domain.FACE: solid, Domain.CORNER: np.repeat(solid, counts)}
    return replace(
        surface,
        attributes=tuple(_select_items(one, kept) for one in surface.attributes),
        groups=tuple(FaceGroups(g.name, g.labels, g.numbers[solid]) for g in surface.groups),
    )


def _select_items(attribute: Attribute, kept: dict[Domain, Mask]) -> Attribute:
    if attribute.domain not in kept:
        return attribute
    items = kept[attribute.domain]
    if attribute.indices is not None:
        return replace(attribute, indices=attribute.indices[items])
    return replace(attribute, values=attribute.values[items])
