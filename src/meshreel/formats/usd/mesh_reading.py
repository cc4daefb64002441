"""A mesh of a stage, frame by frame, as polygons in world space."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.material_reading import MeshMaterials, StageMaterials
from meshreel.formats.usd.primvars import read_attributes
from meshreel.formats.usd.sampling import Codes, attribute_codes, distinct_codes
from meshreel.formats.usd.skinning import Skin
from meshreel.formats.usd.subsets import read_groups
from meshreel.formats.usd.transforms import Transforms, mirrors, placed
from meshreel.sequence import Vertices
from meshreel.surface import Surface


@dataclass(frozen=True, eq=False)
class StageMesh:
    """A mesh of a stage.

    Parameters
    ----------
    stage : Usd.Stage
        Held, for its prims end with it.
    prim : Usd.Prim
    skin : Skin or None
        How a skeleton moves it.
    transforms : Transforms
        Of the stage.
    materials : StageMaterials
        Of the stage.
    notes : list of str
        Gains a sentence for each thing that is not read.
    """

    stage: Any
    prim: Any
    skin: Skin | None
    transforms: Transforms
    materials: StageMaterials
    notes: list[str]

    @property
    def path(self) -> str:
        """Where it is in the stage."""
        return str(self.prim.GetPath())

    @cached_property
    def samples(self) -> Codes:
        """The time codes where anything that moves it has samples; empty if nothing moves it."""
        moving = (
            self.transforms.codes(self.prim)
            if self.skin is None
            else self.skin.codes(self.transforms)
        )
        shape = (self._mesh.GetPointsAttr(), *self._face_attributes)
        return distinct_codes(moving + [code for one in shape for code in attribute_codes(one)])

    def frame(self, code: float) -> PolygonMesh:
        """The mesh in world space at a time code.

        Raises
        ------
        FormatError
            If points or faces are missing, or do not make a mesh.
        """
        with usd_errors(f"USD cannot read {self.path} at time code {code:g}"):
            points = _points(self._value(self._mesh.GetPointsAttr(), code), self.path)
            if self.skin is not None:
                points = self.skin.deformed(points, code)
            world = placed(points, self.transforms.world(self._space, code))
            if not self._has_one_topology:
                return self._polygons(world, code)
            if len(self._first.vertices) != len(world):  # so indices must be looked at again
                return polygon_mesh(world, self._first.counts, self._first.corners)
            return replace(self._first, vertices=world)

    def surface(self, code: float) -> Surface:
        """Attributes and groups at a time code."""
        with usd_errors(f"USD cannot read what {self.path} carries at time code {code:g}"):
            mesh = self.frame(code)
            order = flipped_corners(mesh.counts) if self._is_flipped else None
            materials = MeshMaterials(self.prim, self.materials)
            groups = read_groups(self.prim, code, len(mesh.counts), materials, self.notes)
            attributes = read_attributes(self.prim, code, mesh, order, self.notes)
            return Surface(None, attributes, groups, (), *materials.look())

    @cached_property
    def _mesh(self) -> Any:
        return USD.load("UsdGeom").Mesh(self.prim)

    @property
    def _space(self) -> Any:
        return self.prim if self.skin is None else self.skin.space

    @property
    def _face_attributes(self) -> tuple[Any, Any]:
        return self._mesh.GetFaceVertexCountsAttr(), self._mesh.GetFaceVertexIndicesAttr()

    @cached_property
    def _has_one_topology(self) -> bool:
        return not any(one.ValueMightBeTimeVarying() for one in self._face_attributes)

    @cached_property
    def _start(self) -> float:
        return float(self.samples[0]) if len(self.samples) else 0.0

    @cached_property
    def _first(self) -> PolygonMesh:
        points = _points(self._value(self._mesh.GetPointsAttr(), self._start), self.path)
        return self._polygons(points, self._start)

    @cached_property
    def _is_flipped(self) -> bool:
        """Whether corners have to be taken backwards to go around counter-clockwise."""
        is_left = self._mesh.GetOrientationAttr().Get() == USD.load("UsdGeom").Tokens.leftHanded
        return bool(is_left) != mirrors(self.transforms.world(self._space, self._start))

    def _polygons(self, vertices: Vertices, code: float) -> PolygonMesh:
        counts, corners = (
            _integers(self._value(one, code), self.path) for one in self._face_attributes
        )
        if (counts < 0).any() or counts.sum(dtype=np.int64) != len(corners):
            raise FormatError(
                f"mesh {self.path} has {len(corners)} faceVertexIndices at time code {code:g}; "
                f"its faceVertexCounts need {counts.sum(dtype=np.int64)}"
            )
        found = polygon_mesh(vertices, counts, corners, place=f"mesh {self.path}, face {{}}".format)
        if not self._is_flipped:
            return found
        return replace(found, corners=found.corners[flipped_corners(found.counts)])

    def _value(self, attribute: Any, code: float) -> Any:
        value = attribute.Get(code)
        if value is None:
            raise FormatError(
                f"mesh {self.path} has no {attribute.GetName()} at time code {code:g}"
            )
        return value


def flipped_corners(counts: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The corner that each corner becomes when faces go around the other way.

    The first corner of each face stays the first. Corners are counted through, face after face.
    """
    sizes = np.repeat(counts, counts)
    starts = np.repeat(np.cumsum(counts) - counts, counts)
    flipped: npt.NDArray[np.int64] = starts + (starts - np.arange(len(starts))) % sizes
    return flipped


def _integers(value: Any, path: str) -> npt.NDArray[np.int32]:
    found = np.asarray(value)
    if found.ndim != 1 or (found.size and found.dtype != np.int32):
        raise FormatError(f"mesh {path} has faces of another kind than int[]")
    return found.astype(np.int32, copy=False)


def _points(value: Any, path: str) -> Vertices:
    points: Vertices = np.asarray(value)
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind != "f":
        raise FormatError(f"mesh {path} has points of another kind than point3f")
    return points if points.dtype.itemsize > 2 else points.astype(np.float32)
