"""A mesh of a stage, frame by frame, as polygons in world space."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.surfaces.hard_edges import edges_of_creases, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.holes import faces_of, surface_of
from meshreel.formats.usd.material_reading import MeshMaterials, StageMaterials
from meshreel.formats.usd.mesh_notes import MeshNotes
from meshreel.formats.usd.mesh_shape import MeshShape
from meshreel.formats.usd.primitives import PrimitiveShape
from meshreel.formats.usd.primvars import read_attributes
from meshreel.formats.usd.quantities import Quantity, quantities
from meshreel.formats.usd.sampling import Samples, distinct_codes
from meshreel.formats.usd.skinning import Skin
from meshreel.formats.usd.subsets import read_groups
from meshreel.formats.usd.transforms import Matrix, Transforms, mirrors, placed
from meshreel.model.geometry.hard_edges import remaining_edges
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain, Int32s, Surface

NORMALS_NAME = "normals"
"""Of the quantity of normals."""


@dataclass(frozen=True, eq=False)
class StageMesh:
    """A mesh of a stage.

    Parameters
    ----------
    stage : Usd.Stage
        Held, for its prims end with it.
    shape : MeshShape or PrimitiveShape
        Its points and faces, in its own space.
    skin : Skin or None
        How a skeleton moves it.
    transforms : Transforms
        Of the stage.
    materials : StageMaterials
        Of the stage.
    notes : MeshNotes
        Gain a sentence for each thing that is not read.
    """

    stage: Any
    shape: MeshShape | PrimitiveShape
    skin: Skin | None
    transforms: Transforms
    materials: StageMaterials
    notes: MeshNotes

    @property
    def path(self) -> str:
        """Where it is in the stage."""
        return str(self.prim.GetPath())

    @cached_property
    def samples(self) -> Samples:
        """The time codes where what gives its positions has samples; none if nothing moves it.

        Where nothing does, they are those of what it carries.
        """
        return mesh_samples(*self.motion_codes, self.prim)

    @property
    def motion_codes(self) -> tuple[list[float], list[float]]:
        """Where points and faces have samples, and where what moves the points has."""
        keys = (
            self.transforms.codes(self.prim)
            if self.skin is None
            else self.skin.codes(self.transforms)
        )
        return self.shape.stored, keys + self.shape.keys

    def frame(self, code: float) -> PolygonMesh:
        """The mesh in world space at a time code.

        Raises
        ------
        FormatError
            If points or faces are missing, or do not make a mesh.
        """
        with usd_errors(f"USD cannot read {self.path} at time code {code:g}"):
            points = self.shape.points(code)
            if self.skin is not None:
                points = self.skin.deformed(points, code)
            world = placed(points, self.world(code))
            if not self.shape.has_one_topology:
                return self._polygons(world, code)
            if len(self._first.vertices) != len(world):  # so indices must be looked at again
                return polygon_mesh(world, self._first.counts, self._first.corners)
            return replace(self._first, vertices=world)

    def surface(self, code: float, moving: Collection[str] = ()) -> Surface:
        """Attributes and groups at a time code, but for what moves, by its name in the file."""
        with usd_errors(f"USD cannot read what {self.path} carries at time code {code:g}"):
            mesh = self._whole(self.shape.points(code), code)
            order = flipped_corners(mesh.counts) if self.is_flipped else None
            materials = MeshMaterials(self.prim, self.materials)
            notes = self.notes.plain
            groups = read_groups(self.prim, code, len(mesh.counts), materials, notes)
            attributes = read_attributes(self.prim, code, mesh, order, notes, moving)
            solid = self.shape.solid_faces(len(mesh.counts), code)
            self.notes.add(self.shape, solid)
            hard = self._hard_edges(mesh, code, is_track=NORMALS_NAME in moving)
            surface = Surface(None, attributes, groups, (), *materials.look(), hard)
            if solid is None:
                return surface
            kept = faces_of(mesh, solid)
            hard = remaining_edges(hard, kept.counts, kept.corners)
            return replace(surface_of(surface, solid, mesh.counts), hard_edges=hard)

    def _hard_edges(self, mesh: PolygonMesh, code: float, *, is_track: bool) -> Int32s | None:
        """Those of its normals; without normals, edges that its shape keeps sharp."""
        given = next((one for one in quantities(self.prim) if one.role == NORMALS), None)
        if given is None:
            creases = self.shape.sharp_edges(code)
            if creases is None:
                return None
            found = edges_of_creases(mesh, creases)
            if found.edges is None:
                return None
        else:
            found = find_hard_edges(mesh, self._corner_normals(given, mesh, code))
        self.notes.normals.add(self.path, found, is_track=is_track)
        return found.edges

    def _corner_normals(self, given: Quantity, mesh: PolygonMesh, code: float) -> Values:
        """Normals of shape (C, 3) in the order of the mesh; 0 where they do not fit it."""
        counts = len(mesh.vertices), len(mesh.counts), len(mesh.corners)
        values = given.values(code, dict(zip(Domain, counts, strict=True))[given.domain])
        if values is None or values.shape[1] != 3 or values.dtype.kind != "f":
            return np.zeros((len(mesh.corners), 3))
        if given.domain is Domain.VERTEX:
            return values[mesh.corners]
        if given.domain is Domain.FACE:
            return np.repeat(values, mesh.counts, axis=0)
        return values[flipped_corners(mesh.counts)] if self.is_flipped else values

    def whole(self, code: float) -> PolygonMesh:
        """All its faces at a time code, holes too, counter-clockwise, with points as they are."""
        return self._whole(self.shape.points(code), code)

    def n_copies(self, code: float) -> int:
        """One, as at any time code; copies of a prototype are an `InstancedMesh`."""
        return 1

    def in_world(
        self, one: Quantity, values: Values, counts: npt.NDArray[np.int64], code: float
    ) -> Values:
        """Values of all items of the mesh at a time code, turned as it is, in its order.

        Parameters
        ----------
        values : array of shape (N, C)
            In the order of the file.
        counts : int64 array
            Corners of each face.
        """
        if one.to_world is not None:
            values = one.to_world(values, self.world(code))
        if one.domain is Domain.CORNER and self.is_flipped:
            return values[flipped_corners(counts)]
        return values

    def world(self, code: float) -> Matrix:
        """The transform to the world at a time code."""
        return self.transforms.world(self._space, code)

    @property
    def prim(self) -> Any:
        """The prim that it is."""
        return self.shape.prim

    @property
    def has_moving_transform(self) -> bool:
        """Whether it, or something above it, is moved."""
        return len(self.transforms.codes(self._space)) > 1

    @property
    def _space(self) -> Any:
        return self.prim if self.skin is None else self.skin.space

    @cached_property
    def _start(self) -> float:
        return float(self.samples.all[0]) if len(self.samples.all) else 0.0

    @cached_property
    def _first(self) -> PolygonMesh:
        return self._polygons(self.shape.points(self._start), self._start)

    @cached_property
    def is_flipped(self) -> bool:
        """Whether corners have to be taken backwards to go around counter-clockwise."""
        world = self.world(self._start)
        return self.shape.is_left_handed != mirrors(world)

    def _polygons(self, vertices: Vertices, code: float) -> PolygonMesh:
        """The faces at a time code that are no holes."""
        whole = self._whole(vertices, code)
        solid = self.shape.solid_faces(len(whole.counts), code)
        return whole if solid is None else faces_of(whole, solid)

    def _whole(self, vertices: Vertices, code: float) -> PolygonMesh:
        """All faces at a time code, counter-clockwise."""
        found = self.shape.polygons(vertices, code)
        if not self.is_flipped:
            return found
        return replace(found, corners=found.corners[flipped_corners(found.counts)])


def mesh_samples(stored: list[float], keys: list[float], prim: Any) -> Samples:
    """Where a mesh has samples; of one that does not move, those of what it carries too."""
    if len(distinct_codes(stored + keys)) < 2:
        stored = stored + [code for one in quantities(prim) for code in one.codes]
    return Samples(distinct_codes(stored), distinct_codes(keys))


def flipped_corners(counts: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The corner that each corner becomes when faces go around the other way.

    The first corner of each face stays the first. Corners are counted through, face after face.
    """
    sizes = np.repeat(counts, counts)
    starts = np.repeat(np.cumsum(counts) - counts, counts)
    flipped: npt.NDArray[np.int64] = starts + (starts - np.arange(len(starts))) % sizes
    return flipped
