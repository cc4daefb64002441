"""Reading a mesh of a stage, frame by frame, as polygons in world space."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.surfaces.hard_edges import edges_from_creases, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.material_reading import MeshMaterials, StageMaterials, read_groups
from meshreel.formats.usd.mesh_notes import MeshNotes
from meshreel.formats.usd.mesh_shape import MeshShape, select_faces, select_surface
from meshreel.formats.usd.primitives import PrimitiveShape
from meshreel.formats.usd.primvars import read_attributes
from meshreel.formats.usd.quantities import Quantity, quantities
from meshreel.formats.usd.sampling import Samples, distinct_codes
from meshreel.formats.usd.skinning import Skin
from meshreel.formats.usd.transforms import Matrix, Transforms, is_mirroring, transform_points
from meshreel.model.geometry.hard_edges import remaining_edges
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain, Int32s, Surface

NORMALS_NAME = "normals"
"""Name of the quantity of normals."""


@dataclass(frozen=True, eq=False)
class StageMesh:
    """A mesh of a stage.

    Parameters
    ----------
    stage : Usd.Stage
        Kept alive, since its prims become invalid with it.
    shape : MeshShape or PrimitiveShape
        Points and faces in local space.
    skin : Skin or None
        The skinning by a skeleton.
    transforms : Transforms
        Transforms to the world, or to the prototype.
    materials : StageMaterials
        Materials of the stage.
    notes : MeshNotes
        Gain a sentence for everything that is not read.
    """

    stage: Any
    shape: MeshShape | PrimitiveShape
    skin: Skin | None
    transforms: Transforms
    materials: StageMaterials
    notes: MeshNotes

    @property
    def path(self) -> str:
        """Its path in the stage."""
        return str(self.prim.GetPath())

    @cached_property
    def samples(self) -> Samples:
        """Time codes that determine its frames; empty for a static mesh.

        They are samples of the motion or, if the mesh does not move, of its animated primvars.
        """
        return mesh_samples(*self.motion_codes, self.prim)

    @property
    def motion_codes(self) -> tuple[list[float], list[float]]:
        """Time codes of samples of points and faces, and of transforms and skeletons."""
        keys = (
            self.transforms.codes(self.prim)
            if self.skin is None
            else self.skin.codes(self.transforms)
        )
        return self.shape.stored, keys + self.shape.keys

    def frame(self, code: float) -> PolygonMesh:
        """Return the mesh in world space at a time code.

        Raises
        ------
        FormatError
            If points or faces are missing or invalid.
        """
        with usd_errors(f"USD cannot read {self.path} at time code {code:g}"):
            points = self.shape.points(code)
            if self.skin is not None:
                points = self.skin.deform(points, code)
            world = transform_points(points, self.world(code))
            if not self.shape.has_constant_topology:
                return self._polygons(world, code)
            if len(self._first.vertices) != len(world):  # indices must be validated again
                return polygon_mesh(world, self._first.counts, self._first.corners)
            return replace(self._first, vertices=world)

    def surface(self, code: float, animated: Collection[str] = ()) -> Surface:
        """Return attributes and groups at a time code, without properties that become tracks."""
        with usd_errors(f"USD cannot read the properties of {self.path} at time code {code:g}"):
            mesh = self._with_all_faces(self.shape.points(code), code)
            order = reversed_corners(mesh.counts) if self.is_reversed else None
            materials = MeshMaterials(self.prim, self.materials)
            notes = self.notes.plain
            groups = read_groups(self.prim, code, len(mesh.counts), materials, notes)
            attributes = read_attributes(self.prim, code, mesh, order, notes, animated)
            solid = self.shape.solid_faces(len(mesh.counts), code)
            self.notes.add(self.shape, solid)
            hard_edges = self._hard_edges(mesh, code, is_track=NORMALS_NAME in animated)
            surface = Surface(None, attributes, groups, (), *materials.look(), hard_edges)
            if solid is None:
                return surface
            kept = select_faces(mesh, solid)
            hard_edges = remaining_edges(hard_edges, kept.counts, kept.corners)
            return replace(select_surface(surface, solid, mesh.counts), hard_edges=hard_edges)

    def _hard_edges(self, mesh: PolygonMesh, code: float, *, is_track: bool) -> Int32s | None:
        """Return the hard edges implied by its normals, or else by sharp edges of its shape."""
        normals = next((one for one in quantities(self.prim) if one.role == NORMALS), None)
        if normals is None:
            creases = self.shape.sharp_edges(code)
            if creases is None:
                return None
            hard_edges = edges_from_creases(mesh, creases)
            if hard_edges.edges is None:
                return None
        else:
            hard_edges = find_hard_edges(mesh, self._corner_normals(normals, mesh, code))
        self.notes.normals.add(self.path, hard_edges, is_track=is_track)
        return hard_edges.edges

    def _corner_normals(self, quantity: Quantity, mesh: PolygonMesh, code: float) -> Values:
        """Return the normals of corners, of shape (C, 3), or zeros if their count is wrong."""
        counts = len(mesh.vertices), len(mesh.counts), len(mesh.corners)
        values = quantity.values(code, dict(zip(Domain, counts, strict=True))[quantity.domain])
        if values is None or values.shape[1] != 3 or values.dtype.kind != "f":
            return np.zeros((len(mesh.corners), 3))
        if quantity.domain is Domain.VERTEX:
            return values[mesh.corners]
        if quantity.domain is Domain.FACE:
            return np.repeat(values, mesh.counts, axis=0)
        return values[reversed_corners(mesh.counts)] if self.is_reversed else values

    def all_faces(self, code: float) -> PolygonMesh:
        """Return all faces at a time code, including holes, with points in local space."""
        return self._with_all_faces(self.shape.points(code), code)

    def n_instances(self, code: float) -> int:
        """Return 1: instances of a prototype are an `InstancedMesh`."""
        return 1

    def in_world(
        self, one: Quantity, values: Values, counts: npt.NDArray[np.int64], code: float
    ) -> Values:
        """Return values in world space at a time code, with corners in the order of the mesh.

        Parameters
        ----------
        values : array of shape (N, C)
            Values in file order.
        counts : int64 array
            Corners of each face.
        """
        if one.to_world is not None:
            values = one.to_world(values, self.world(code))
        if one.domain is Domain.CORNER and self.is_reversed:
            return values[reversed_corners(counts)]
        return values

    def world(self, code: float) -> Matrix:
        """Return the matrix to the world at a time code."""
        return self.transforms.world(self._space, code)

    @property
    def prim(self) -> Any:
        """The prim of the mesh."""
        return self.shape.prim

    @property
    def has_moving_transform(self) -> bool:
        """Whether its transform, or one above it, is animated."""
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
    def is_reversed(self) -> bool:
        """Whether corners must be reversed to be counterclockwise in world space."""
        world = self.world(self._start)
        return self.shape.is_left_handed != is_mirroring(world)

    def _polygons(self, vertices: Vertices, code: float) -> PolygonMesh:
        """Return the faces at a time code, without holes."""
        mesh = self._with_all_faces(vertices, code)
        solid = self.shape.solid_faces(len(mesh.counts), code)
        return mesh if solid is None else select_faces(mesh, solid)

    def _with_all_faces(self, vertices: Vertices, code: float) -> PolygonMesh:
        """Return all faces at a time code, counterclockwise."""
        polygons = self.shape.polygons(vertices, code)
        if not self.is_reversed:
            return polygons
        return replace(polygons, corners=polygons.corners[reversed_corners(polygons.counts)])


def mesh_samples(stored: list[float], keys: list[float], prim: Any) -> Samples:
    """Return the sample time codes of a mesh, including those of its primvars if it is static."""
    if len(distinct_codes(stored + keys)) < 2:
        stored = stored + [code for one in quantities(prim) for code in one.codes]
    return Samples(distinct_codes(stored), distinct_codes(keys))


def reversed_corners(counts: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return the permutation that reverses the corners of each face after the first one."""
    sizes = np.repeat(counts, counts)
    starts = np.repeat(np.cumsum(counts) - counts, counts)
    order: npt.NDArray[np.int64] = starts + (starts - np.arange(len(starts))) % sizes
    return order
