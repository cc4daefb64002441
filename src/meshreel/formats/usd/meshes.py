"""Points and faces of a mesh prim, without faces that are holes."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS, Field, Key, field_tracks
from meshreel.formats.frames.stored_frames import changed_error
from meshreel.formats.notes import (
    LEFT_OUT,
    GatheredNote,
    describe_cages,
    listed,
    note_kinds,
    note_left_out,
)
from meshreel.formats.scenes.vector_transforms import transform_vectors
from meshreel.formats.surfaces.hard_edges import NormalNotes, edges_from_creases, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.usd.materials import MeshMaterials, StageMaterials, read_groups
from meshreel.formats.usd.primitives import N_AROUND, PRIMITIVES, PrimitiveShape
from meshreel.formats.usd.quantities import (
    TRACK_KIND,
    TRACK_NAME,
    UNIT,
    Quantity,
    quantities,
    read_attributes,
)
from meshreel.formats.usd.rendered import (
    Matrix,
    Placements,
    Transforms,
    all_prims_predicate,
    is_mirroring,
    transform_instances,
    transform_points,
)
from meshreel.formats.usd.sampling import TOLERANCE, Codes, Samples, attribute_codes, distinct_codes
from meshreel.formats.usd.stage import usd_errors
from meshreel.model.geometry.hard_edges import merged_edges, remaining_edges
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Attribute, Domain, FaceGroups, Int32s, Surface
from meshreel.model.tracks import TrackSource
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


@dataclass(frozen=True, eq=False)
class BlendShapes:
    """The blend shapes of a mesh.

    Attributes
    ----------
    query : UsdSkel.BlendShapeQuery
    point_indices : list
        Per shape, the indices of the points that it moves.
    offsets : list
        Per shape and inbetween, the offsets of these points.
    """

    query: Any
    point_indices: Any
    offsets: Any


@dataclass(frozen=True, eq=False)
class Skin:
    """The deformation of a mesh by a skeleton.

    Attributes
    ----------
    skeleton_prim : Usd.Prim
        The skeleton in the stage; for an instance, the query has only its prototype.
    skeleton : UsdSkel.SkeletonQuery
    skinning : UsdSkel.SkinningQuery
    """

    skeleton_prim: Any
    skeleton: Any
    skinning: Any
    shapes: BlendShapes | None

    @property
    def space(self) -> Any:
        """The prim in whose space the deformed points are."""
        has_joints = self.skinning.HasJointInfluences()
        return self.skeleton_prim if has_joints else self.skinning.GetPrim()

    def codes(self, transforms: Transforms) -> list[float]:
        """Return the time codes where transforms, joints or blend shapes have samples."""
        codes = transforms.codes(self.space)
        if bind_transform := self.skinning.GetGeomBindTransformAttr():
            codes = codes + attribute_codes(bind_transform)
        if animation := self.skeleton.GetAnimQuery():
            if self.skinning.HasJointInfluences():
                codes = codes + list(animation.GetJointTransformTimeSamples())
            if self.shapes is not None:
                codes = codes + list(animation.GetBlendShapeWeightTimeSamples())
        return codes

    def deform(self, points: Vertices, code: float) -> Vertices:
        """Return deformed points in `space`, from points in local space, as float32 of (V, 3).

        Raises
        ------
        FormatError
            If weights, joints or shapes do not match the points.
        """
        array = USD.load("Vt").Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32))
        is_valid = self.shapes is None or self._blend(self.shapes, array, code)
        if is_valid and self.skinning.HasJointInfluences():
            joints = self.skeleton.ComputeSkinningTransforms(code)
            is_valid = bool(joints) and self.skinning.ComputeSkinnedPoints(joints, array, code)
        if not is_valid:
            path = self.skinning.GetPrim().GetPath()
            raise FormatError(
                f"mesh {path} has {len(points)} points, which its joint weights or blend shapes do "
                f"not match at time code {code:g}; bind it to its skeleton again"
            )
        return np.asarray(array)

    def _blend(self, shapes: BlendShapes, points: Any, code: float) -> bool:
        """Apply blend shapes to the points in place, and return whether that succeeded."""
        animation = self.skeleton.GetAnimQuery()
        if not animation or not (all_weights := animation.ComputeBlendShapeWeights(code)):
            return True
        own = self.skinning.GetBlendShapeMapper().Remap(all_weights, type(all_weights)(), 1)
        weights = shapes.query.ComputeSubShapeWeights(own)
        return bool(
            shapes.query.ComputeDeformedPoints(
                *weights, shapes.point_indices, shapes.offsets, points
            )
        )


def find_skins(prims: Iterable[Any]) -> dict[str, Skin]:
    """Return the skins of the meshes that a skeleton deforms, by path of the mesh."""
    skel = USD.load("UsdSkel")
    roots = {str(root.GetPath()): root for root in map(skel.Root.Find, prims) if root}
    skins = {}
    for root in roots.values():
        for skin in _skins_below(root):
            skins[str(skin.skinning.GetPrim().GetPath())] = skin
    return skins


def _skins_below(root: Any) -> Iterator[Skin]:
    predicate, cache = all_prims_predicate(), USD.load("UsdSkel").Cache()
    cache.Populate(root, predicate)
    for binding in cache.ComputeSkelBindings(root, predicate):
        skeleton = cache.GetSkelQuery(binding.GetSkeleton())
        for skinning in binding.GetSkinningTargets() if skeleton else ():
            if skinning.HasJointInfluences() or skinning.HasBlendShapes():
                prim = binding.GetSkeleton().GetPrim()
                yield Skin(prim, skeleton, skinning, _shapes(skinning))


def _shapes(skinning: Any) -> BlendShapes | None:
    if not skinning.HasBlendShapes():
        return None
    skel = USD.load("UsdSkel")
    query = skel.BlendShapeQuery(skel.BindingAPI(skinning.GetPrim()))
    return BlendShapes(
        query, query.ComputeBlendShapePointIndices(), query.ComputeSubShapePointOffsets()
    )


class MeshNotes:
    """Collects notes on the meshes of a file.

    Parameters
    ----------
    plain : list of str
        All notes of the file.

    Attributes
    ----------
    sampled : GatheredNote
        Lists meshes whose samples differ from their frames.
    final : GatheredNote
        Lists meshes whose last sample is between two frames.
    normals : NormalNotes
        Covers meshes with normals.
    """

    def __init__(self, plain: list[str]) -> None:
        self.plain = plain
        self.sampled: GatheredNote = GatheredNote(plain, _describe_sampled)
        self.final: GatheredNote = GatheredNote(plain, _describe_final)
        self.normals: NormalNotes = NormalNotes(plain)
        self._cages = GatheredNote(plain, describe_cages)
        self._holes = GatheredNote(plain, _describe_holes)
        self._flat = GatheredNote(plain, _describe_flat)
        self._round = GatheredNote(plain, _describe_round)

    def add(self, shape: MeshShape | PrimitiveShape, solid: Mask | None) -> None:
        """Note the properties of a mesh; `solid` is a mask of the faces that are not holes."""
        path = str(shape.prim.GetPath())
        if isinstance(shape, PrimitiveShape):
            note = self._round if PRIMITIVES[shape.kind].is_round else self._flat
            note.add(f"{path} ({shape.kind})")
        if shape.is_subdivided:
            self._cages.add(path)
        if solid is not None:
            self._holes.add(f"{np.count_nonzero(~solid)} of {len(solid)} of {path}")


def _describe_sampled(paths: Sequence[str]) -> str:
    return f"frames differ from samples; USD interpolates at each frame: {listed(paths)}"


def _describe_final(paths: Sequence[str]) -> str:
    return f"the last frame shows the final pose, which is earlier: {listed(paths)}"


def _describe_holes(counts: Sequence[str]) -> str:
    return f"{LEFT_OUT}faces that are holes: {listed(counts)}"


def _describe_flat(paths: Sequence[str]) -> str:
    return f"read as {'a mesh' if len(paths) == 1 else 'meshes'}: {listed(paths)}"


def _describe_round(paths: Sequence[str]) -> str:
    kind = "a mesh" if len(paths) == 1 else "meshes"
    return f"read as {kind} with {N_AROUND} faces around, within 1 % of the radius: {listed(paths)}"


NORMALS_NAME = "normals"
"""Name of the quantity of normals."""


def shape_of(prim: Any) -> MeshShape | PrimitiveShape:
    """Return the shape of a mesh or primitive prim, in its local space."""
    return PrimitiveShape(prim) if prim.GetTypeName() in PRIMITIVES else MeshShape(prim)


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


MAX_FRAME_BYTES = 1 << 30
"""Limit of positions and faces of all instances in a frame."""


@dataclass(frozen=True, eq=False)
class InstancedMesh:
    """All instances of a mesh of a prototype, concatenated.

    Parameters
    ----------
    path : str
        Name of the result; other instancers may instance the same mesh.
    mesh : StageMesh
        In the space of the prototype.
    placements : Placements
        Transforms of the instances.
    """

    path: str
    mesh: StageMesh
    placements: Placements

    @property
    def prim(self) -> Any:
        """The prim of the mesh."""
        return self.mesh.prim

    @property
    def skin(self) -> Skin | None:
        """The skinning of the mesh, if any."""
        return self.mesh.skin

    @property
    def shape(self) -> MeshShape | PrimitiveShape:
        """Points and faces of the mesh in its local space."""
        return self.mesh.shape

    @property
    def notes(self) -> MeshNotes:
        """Notes on the meshes of the file."""
        return self.mesh.notes

    @property
    def has_moving_transform(self) -> bool:
        """Whether the instances move, or the mesh within its prototype."""
        return len(set(self.placements.codes)) > 1 or self.mesh.has_moving_transform

    @cached_property
    def samples(self) -> Samples:
        """Time codes where the mesh, its instances or prims above them have samples."""
        stored, keys = self.mesh.motion_codes
        return mesh_samples(stored, keys + self.placements.codes, self.prim)

    def frame(self, code: float) -> PolygonMesh:
        """Return all instances in world space at a time code; mirrored faces are reversed.

        Raises
        ------
        FormatError
            If there are no instances at the time code, or too many, or the mesh cannot be read.
        """
        with usd_errors(f"USD cannot read {self.path} at time code {code:g}"):
            one, matrices = self.mesh.frame(code), self.placements.world(code)
            if not len(matrices):
                raise FormatError(
                    f"{self.path} has no instance at time code {code:g}, so its frame would be "
                    "empty; remove such time codes, or select another mesh with --object (object=)"
                )
            size_bytes = len(matrices) * (24 * len(one.vertices) + 4 * len(one.corners))
            n_verts = len(matrices) * len(one.vertices)
            if size_bytes > MAX_FRAME_BYTES or n_verts > np.iinfo(np.int32).max:
                raise FormatError(
                    f"{self.path}: {len(matrices)} instances of {len(one.vertices)} vertices need "
                    f"{size_bytes:.3g} bytes; the limit is {MAX_FRAME_BYTES}"
                )
            return PolygonMesh(
                transform_instances(one.vertices, matrices),
                *_instance_faces(one, _mirrored(matrices)),
            )

    def surface(self, code: float, animated: Collection[str] = ()) -> Surface:
        """Return the attributes and groups of all instances, as in `StageMesh.surface`."""
        surface = self.mesh.surface(code, animated)
        frame = self.mesh.frame(code)
        with usd_errors(f"USD cannot read the instances of {self.path} at time code {code:g}"):
            return _instance_surface(surface, frame, _mirrored(self.placements.world(code)))

    def all_faces(self, code: float) -> PolygonMesh:
        """Return all faces of a single instance, as in `StageMesh.all_faces`."""
        return self.mesh.all_faces(code)

    def n_instances(self, code: float) -> int:
        """Return the number of instances at a time code."""
        return len(self.placements.world(code))

    def in_world(
        self, one: Quantity, values: Values, counts: npt.NDArray[np.int64], code: float
    ) -> Values:
        """Return values of a mesh for every instance, transformed with it, of shape (I * N, C)."""
        own = self.mesh.in_world(one, values, counts, code)
        matrices = self.placements.world(code)
        copies = [own if one.to_world is None else one.to_world(own, each) for each in matrices]
        if one.domain is Domain.CORNER:
            order = reversed_corners(counts)
            pairs = zip(copies, _mirrored(matrices), strict=True)
            copies = [each[order] if is_mirrored else each for each, is_mirrored in pairs]
        return np.concatenate(copies) if copies else own[:0]


def note_instances(meshes: Sequence[InstancedMesh], notes: list[str]) -> None:
    """Note the instances of a file: their number, those left out, and changes over time.

    Parameters
    ----------
    meshes : sequence of InstancedMesh
    notes : list of str
        Gains the sentences.
    """
    if not meshes:
        return
    instancers = {one.instancer.path: one.instancer for m in meshes for one in m.placements.levels}
    counts, masked, changing, primvars = [], [], [], dict[str, None]()
    for path, one in instancers.items():
        with suppress(FormatError):  # raised again when its meshes are read
            _, is_rendered = one.selection(min(one.selection_codes, default=0.0))
            counts.append(int(np.count_nonzero(is_rendered)))
            if not is_rendered.all():
                masked.append(f"{np.count_nonzero(~is_rendered)} of {len(is_rendered)} of {path}")
            if one.selection_changes():
                changing.append(path)
        primvars |= dict.fromkeys(one.instance_primvars)
    where = f" of {len(counts)} point instancers" if len(counts) > 1 else ""
    notes.append(
        f"baked {counted(sum(counts), 'instance')}{where} into one mesh per prototype mesh"
    )
    if masked:
        note_left_out(notes, f"instances that are inactive or invisible: {listed(masked)}")
    if changing:
        notes.append(
            f"the rendered instances change over time: {listed(changing)}; the vertices of a frame "
            "are those of the instances in that frame, in file order"
        )
    if primvars:
        note_left_out(notes, f"primvars of instances: {listed(primvars)}")


def _mirrored(matrices: npt.NDArray[np.float64]) -> Mask:
    with np.errstate(all="ignore"):
        is_mirrored: Mask = np.linalg.det(matrices[:, :3, :3]) < 0
    return is_mirrored


def _instance_faces(
    mesh: PolygonMesh, is_mirrored: Mask
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    starts = len(mesh.vertices) * np.arange(len(is_mirrored), dtype=np.int32)
    corners = np.tile(mesh.corners, (len(is_mirrored), 1))
    corners[is_mirrored] = mesh.corners[reversed_corners(mesh.counts)]
    return np.tile(mesh.counts, len(is_mirrored)), (corners + starts[:, np.newaxis]).ravel()


def _instance_surface(surface: Surface, frame: PolygonMesh, is_mirrored: Mask) -> Surface:
    n_instances = len(is_mirrored)

    def instance(one: Attribute) -> Attribute:
        indices: Int32s | None = one.indices
        items = np.arange(len(one.values), dtype=np.int32) if indices is None else indices
        rows = np.tile(items, (n_instances, 1))
        if one.domain is Domain.CORNER:
            rows[is_mirrored] = items[reversed_corners(frame.counts)]
        return replace(one, indices=rows.ravel())

    groups = (replace(one, numbers=np.tile(one.numbers, n_instances)) for one in surface.groups)
    return replace(
        surface,
        attributes=tuple(instance(one) for one in surface.attributes),
        groups=tuple(groups),
        hard_edges=merged_edges(
            [surface.hard_edges] * n_instances, [len(frame.vertices)] * n_instances
        ),
    )


MISMATCHED = "primvars that do not fit their faces"
COLOR, OPACITY = "displayColor", "displayOpacity"


class MeshTracks:
    """The quantities of a mesh that change over its frames, as tracks.

    Parameters
    ----------
    codes : Codes
        Time codes of its frames.
    notes : list of str
        Gains a sentence for each quantity that is not read.
    """

    def __init__(self, mesh: StageMesh | InstancedMesh, codes: Codes, notes: list[str]) -> None:
        self._mesh, self._codes, self._notes = mesh, codes, notes

    @cached_property
    def animated(self) -> dict[str, Quantity]:
        """The animated quantities, by name in the file.

        Normals and velocities of skinned meshes are skipped, since skinning does not deform them.
        """
        is_skinned = self._mesh.skin is not None
        candidates = (
            one for one in quantities(self._mesh.prim) if not (is_skinned and one.to_world)
        )
        with usd_errors(f"USD cannot read the properties of {self._mesh.path}"):
            return {one.name: one for one in candidates if one.is_animated(self._codes)}

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """Return the tracks over a range of frames with the same faces."""
        if not self.animated:
            return {}
        codes = [float(self._codes[index]) for index in frames]
        tracks = {(one.domain, name): one for name, one in _by_track_name(self.animated).items()}
        with usd_errors(f"USD cannot read the properties of {self._mesh.path}"):
            self._note_samples()
            mesh = self._mesh.all_faces(codes[0])
            solid = self._mesh.shape.solid_faces(len(mesh.counts), codes[0])
            n_instances = self._mesh.n_instances(codes[0])
            fields = [self._fields(tracks, code, mesh) for code in codes]
        fitting = {key for frame in fields for key in frame}
        note_kinds(self._notes, MISMATCHED, (name for _, name in tracks.keys() - fitting))
        masks = _item_masks(mesh, solid)
        kept = {domain: np.tile(mask, n_instances) for domain, mask in masks.items()}
        sizes = {domain: int(np.count_nonzero(mask)) for domain, mask in kept.items()}

        def read(index: int, key: Key) -> Values:
            with usd_errors(f"USD cannot read the properties of {self._mesh.path}"):
                values = self._values(tracks[key], codes[index], mesh)
                if values is not None:
                    values = self._mesh.in_world(tracks[key], values, mesh.counts, codes[index])
            if values is None or len(values) != len(kept[key[0]]):
                raise changed_error(f"{self._mesh.path} (time code {codes[index]:g})")
            return values[kept[key[0]]]

        return field_tracks(fields, sizes, read, self._notes)

    def _fields(
        self, tracks: Mapping[Key, Quantity], code: float, mesh: PolygonMesh
    ) -> dict[Key, Field]:
        fields: dict[Key, Field] = {}
        for key, one in tracks.items():
            values = self._values(one, code, mesh)
            if values is not None:
                kind = one.custom_data(TRACK_KIND) or one.kind
                unit = one.custom_data(UNIT)
                fields[key] = Field(values.dtype, values.shape[1], one.role, kind, unit)
        return fields

    def _values(self, one: Quantity, code: float, mesh: PolygonMesh) -> Values | None:
        """Return values in file order, for all faces of the mesh."""
        counts = len(mesh.vertices), len(mesh.counts), len(mesh.corners)
        return one.values(code, dict(zip(Domain, counts, strict=True))[one.domain])

    def _note_samples(self) -> None:
        """Note samples that no frame has, and velocities of animated transforms."""
        names = []
        for one in self.animated.values():
            own = np.asarray(one.codes)
            nearest = np.searchsorted(self._codes, own - TOLERANCE).clip(0, len(self._codes) - 1)
            n_other = int((np.abs(self._codes[nearest] - own) > TOLERANCE).sum())
            if n_other:
                names.append(f"{one.name} ({n_other} of {len(own)})")
        note_kinds(self._notes, "samples where positions have no frame", names)
        has_rates = any(one.to_world is transform_vectors for one in self.animated.values())
        if has_rates and self._mesh.has_moving_transform:
            note_left_out(self._notes, f"velocity of the transforms above {self._mesh.path}")


def _by_track_name(animated: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Return animated quantities by track name: as written by meshreel, or else as in the file.

    A color and its opacity become one quantity if they have the same items.
    """
    by_name = dict(animated)
    color, opacity = by_name.get(COLOR), by_name.get(OPACITY)
    if color is not None and opacity is not None and _have_same_items(color, opacity):
        by_name[COLOR] = replace(color, read=partial(_read_rgba, color, opacity))
        del by_name[OPACITY]
    names = {name: one.custom_data(TRACK_NAME) or name for name, one in by_name.items()}
    every = list(names.values())
    return {
        names[name] if every.count(names[name]) == 1 else name: by_name[name] for name in by_name
    }


def _have_same_items(color: Quantity, opacity: Quantity) -> bool:
    is_same_layout = (color.domain, color.is_constant) == (opacity.domain, opacity.is_constant)
    is_same_track = color.custom_data(TRACK_NAME) == opacity.custom_data(TRACK_NAME)
    return is_same_layout and is_same_track and color.codes == opacity.codes


def _read_rgba(color: Quantity, opacity: Quantity, code: float) -> Values | None:
    """Return color and opacity as four components, or None if their counts differ."""
    first, second = color.read(code), opacity.read(code)
    if first is None or second is None or len(first) != len(second) or second.shape[1] != 1:
        return None
    return np.concatenate([first, second], axis=1)


def _item_masks(mesh: PolygonMesh, solid: Mask | None) -> dict[Domain, Mask]:
    """Return masks of the vertices, faces and corners that do not belong to holes."""
    faces = np.ones(len(mesh.counts), bool) if solid is None else solid
    return {
        Domain.VERTEX: np.ones(len(mesh.vertices), bool),
        Domain.FACE: faces,
        Domain.CORNER: np.repeat(faces, mesh.counts),
    }
