"""A mesh of a stage, frame by frame, in world space: points, faces, attributes and tracks."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.scenes.quantities import normals_of_corners, note_quantities, quantity_tracks
from meshreel.formats.scenes.transforms import is_mirroring, transform_points
from meshreel.formats.surfaces.hard_edges import NormalNotes, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh, reversed_corners
from meshreel.formats.usd.materials import StageMaterials, read_materials
from meshreel.formats.usd.quantities import (
    StageQuantity,
    by_track_name,
    quantities,
    read_attributes,
)
from meshreel.formats.usd.sampling import (
    ARE_FRAMES,
    TOLERANCE,
    Samples,
    attribute_codes,
    distinct_codes,
)
from meshreel.formats.usd.stage import usd_errors
from meshreel.formats.usd.unread import MISFITS, StageContents
from meshreel.model.geometry.hard_edges import remaining_edges
from meshreel.model.notes import CAGES
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain, Int32s, Surface
from meshreel.model.tracks import TrackSource
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import USD

FACE_ATTRIBUTES = ("faceVertexCounts", "faceVertexIndices")
HOLES = "holeIndices"
FACE_SETTINGS = ("orientation", "subdivisionScheme")
SKINNING = re.compile(
    "primvars:skel:|joint|(bind|rest)Transforms|scales|rotations|translations|blendShape|"
    "(inbetweens:[^:]*|offsets|pointIndices)$"
)
"""Properties of skinned meshes, skeletons, animations and blend shapes."""

Mask = npt.NDArray[np.bool_]


def ancestors(prim: Any) -> Iterator[Any]:
    """Yield a prim and those above it."""
    while prim and not prim.IsPseudoRoot():
        yield prim
        prim = prim.GetParent()


class Transforms:
    """Transforms of the prims of a stage to the world, at any time code."""

    def __init__(self) -> None:
        self._cache = USD.load("UsdGeom").XformCache()

    def codes(self, prim: Any) -> list[float]:
        """Return the time codes where transforms of a prim or its ancestors have samples."""
        codes: list[float] = []
        for above in ancestors(prim):
            if xformable := USD.load("UsdGeom").Xformable(above):
                for operation in xformable.GetOrderedXformOps():
                    codes += attribute_codes(operation.GetAttr())
                if xformable.GetResetXformStack():
                    break
        return codes

    def world(self, prim: Any, code: float) -> Floats:
        """Return the matrix from the prim to the world, of shape (4, 4), for row vectors."""
        self._cache.SetTime(code)
        return np.array(self._cache.GetLocalToWorldTransform(prim), np.float64)


@dataclass(frozen=True, eq=False)
class MeshShape:
    """Points and faces of a mesh prim in local space, at any time code."""

    prim: Any

    @property
    def codes(self) -> list[float]:
        """Time codes where points and faces have samples."""
        attributes = map(self.prim.GetAttribute, ("points", *FACE_ATTRIBUTES, HOLES))
        return [code for item in attributes if item for code in attribute_codes(item)]

    @cached_property
    def has_constant_topology(self) -> bool:
        """Whether its faces are the same at all times."""
        attributes = map(self.prim.GetAttribute, (*FACE_ATTRIBUTES, HOLES))
        return not any(attribute.ValueMightBeTimeVarying() for attribute in attributes)

    def points(self, code: float) -> Vertices:
        """Return the points at a time code, of shape (V, 3).

        Raises
        ------
        FormatError
            If there are none, or they have another type.
        """
        points: Vertices = np.asarray(self._value("points", code))
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
        counts, corners = (np.asarray(self._value(name, code)) for name in FACE_ATTRIBUTES)
        if any(
            array.ndim != 1 or (array.size and array.dtype != np.int32)
            for array in (counts, corners)
        ):
            raise FormatError(f"mesh {self._path} has faces of a type other than int[]")
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
        location = f"mesh {self._path}, face {{}}".format
        return polygon_mesh(vertices, counts, corners, location=location)

    def solid_faces(self, n_faces: int, code: float) -> Mask | None:
        """Return a mask of the faces that are not holes at a time code, or None without holes.

        Indices of holes that are out of range are ignored.

        Raises
        ------
        FormatError
            If all faces are holes.
        """
        holes = self.prim.GetAttribute(HOLES).Get(code)
        numbers = np.asarray([] if holes is None else holes)
        numbers = numbers[(numbers >= 0) & (numbers < n_faces)]
        if not len(numbers):
            return None
        is_solid = np.ones(n_faces, bool)
        is_solid[numbers] = False
        if not is_solid.any():
            raise FormatError(f"mesh {self._path} has {n_faces} faces, and all of them are holes")
        return is_solid

    @property
    def _path(self) -> str:
        return str(self.prim.GetPath())

    def _value(self, name: str, code: float) -> Any:
        value = self.prim.GetAttribute(name).Get(code)
        if value is None:
            raise FormatError(f"mesh {self._path} has no {name} at time code {code:g}")
        return value


@dataclass(frozen=True, eq=False)
class Skin:
    """The deformation of a mesh by a skeleton."""

    skeleton_prim: Any
    """Usd.Prim. The skeleton in the stage; for an instance, the query has only its prototype."""
    skeleton: Any
    skinning: Any
    shapes: Any
    """UsdSkel.BlendShapeQuery or None."""

    @property
    def space(self) -> Any:
        """The prim in whose space the deformed points are."""
        has_joints = self.skinning.HasJointInfluences()
        return self.skeleton_prim if has_joints else self.skinning.GetPrim()

    @property
    def prims(self) -> list[Any]:
        """The skeleton, its animation and the blend shapes."""
        others = [self.skeleton.GetAnimQuery()]
        if shapes := self.shapes:
            others += map(shapes.GetBlendShape, range(shapes.GetNumBlendShapes()))
        return [self.skeleton_prim, *(other.GetPrim() for other in others if other)]

    @property
    def codes(self) -> list[float]:
        """Time codes where joints or blend shapes have samples."""
        bind_transform = self.skinning.GetGeomBindTransformAttr()
        codes = attribute_codes(bind_transform) if bind_transform else []
        if animation := self.skeleton.GetAnimQuery():
            if self.skinning.HasJointInfluences():
                codes = codes + list(animation.GetJointTransformTimeSamples())
            if self.shapes is not None:
                codes = codes + list(animation.GetBlendShapeWeightTimeSamples())
        return codes

    @cached_property
    def _deltas(self) -> tuple[Any, Any]:
        """Per blend shape, the indices of the points that it moves; per inbetween, offsets."""
        shapes = self.shapes
        return shapes.ComputeBlendShapePointIndices(), shapes.ComputeSubShapePointOffsets()

    def deform(self, points: Vertices, code: float) -> Vertices:
        """Return deformed points in `space`, from points in local space, as float32 of (V, 3).

        Raises
        ------
        FormatError
            If weights, joints or shapes do not match the points.
        """
        array = USD.load("Vt").Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32))
        is_valid = self.shapes is None or self._blend(array, code)
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

    def _blend(self, points: Any, code: float) -> bool:
        """Apply blend shapes to the points in place, and return whether that succeeded."""
        animation = self.skeleton.GetAnimQuery()
        if not animation or not (all_weights := animation.ComputeBlendShapeWeights(code)):
            return True
        weights = self.skinning.GetBlendShapeMapper().Remap(all_weights, type(all_weights)(), 1)
        weights = self.shapes.ComputeSubShapeWeights(weights)
        return bool(self.shapes.ComputeDeformedPoints(*weights, *self._deltas, points))


def find_skins(prims: Iterable[Any]) -> dict[str, Skin]:
    """Return the skins of the meshes that a skeleton deforms, by path of the mesh."""
    skel, skins = USD.load("UsdSkel"), dict[str, Skin]()
    predicate = USD.load("Usd").TraverseInstanceProxies()
    roots = {str(root.GetPath()): root for root in map(skel.Root.Find, prims) if root}
    for root in roots.values():
        cache = skel.Cache()
        cache.Populate(root, predicate)
        for binding in cache.ComputeSkelBindings(root, predicate):
            skeleton = cache.GetSkelQuery(binding.GetSkeleton())
            for skinning in binding.GetSkinningTargets() if skeleton else ():
                prim, shapes = skinning.GetPrim(), None
                if skinning.HasBlendShapes():
                    shapes = skel.BlendShapeQuery(skel.BindingAPI(prim))
                if skinning.HasJointInfluences() or shapes is not None:
                    skin = Skin(binding.GetSkeleton().GetPrim(), skeleton, skinning, shapes)
                    skins[str(prim.GetPath())] = skin
    return skins


@dataclass(frozen=True, eq=False)
class StageMesh:
    """A mesh of a stage."""

    contents: StageContents
    """Records what is read."""
    prim: Any
    transforms: Transforms
    skin: Skin | None
    """The skinning by a skeleton."""
    materials: StageMaterials
    """Materials of the stage."""
    normal_notes: NormalNotes
    """Collects meshes with normals."""

    @property
    def path(self) -> str:
        """Its path in the stage."""
        return str(self.prim.GetPath())

    @cached_property
    def samples(self) -> Samples:
        """Time codes that determine its frames; empty for a static mesh.

        They are samples of the motion or, if the mesh does not move, of its animated primvars.
        """
        shape_codes, keys = self._shape.codes, self._transform_codes
        keys = keys + ([] if self.skin is None else self.skin.codes)
        if len(distinct_codes(shape_codes + keys)) < 2:
            shape_codes = shape_codes + [
                code for quantity in quantities(self.prim) for code in quantity.times()
            ]
        are_frames = any(above.GetCustomDataByKey(ARE_FRAMES) for above in ancestors(self.prim))
        tolerance = 0.0 if are_frames else TOLERANCE
        source = self.prim.GetAttribute("points").GetResolveInfo().GetSource()
        return Samples(
            distinct_codes(shape_codes, tolerance),
            distinct_codes(keys, tolerance),
            are_frames,
            source == USD.load("Usd").ResolveInfoSourceValueClips,
        )

    def frame(self, code: float) -> PolygonMesh:
        """Return the mesh in world space at a time code, counterclockwise and without holes.

        Raises
        ------
        FormatError
            If points or faces are missing or invalid.
        """
        with usd_errors(f"USD cannot read {self.path} at time code {code:g}"):
            points = self._shape.points(code)
            points = points if self.skin is None else self.skin.deform(points, code)
            vertices = transform_points(points, self._matrix(code))
            if not self._shape.has_constant_topology:
                return self._polygons(vertices, code)
            first = self._first
            if len(first.vertices) != len(vertices):  # indices must be validated again
                return polygon_mesh(vertices, first.counts, first.corners)
            return replace(first, vertices=vertices)

    def surface(self, code: float, animated: Collection[str] = ()) -> Surface:
        """Return attributes and groups at a time code, without properties that become tracks."""
        with usd_errors(f"USD cannot read the properties of {self.path} at time code {code:g}"):
            self._record()
            mesh = self._file_mesh(code)
            rows = self._rows(mesh.counts, code)
            face_groups, materials, images = read_materials(
                self.prim, code, len(mesh.counts), self.materials
            )
            faces = rows[Domain.FACE]
            groups = [replace(group, numbers=group.numbers[faces]) for group in face_groups]
            attributes = read_attributes(
                self.prim, code, mesh.n_items, rows, self.contents, animated
            )
            if self.prim.GetAttribute("subdivisionScheme").Get() != "none":
                self.contents.notes.left_out(CAGES, [self.path])
                names = map(str, self.prim.GetAuthoredPropertyNames())  # what a subdivision uses
                self.contents.add(self.prim, *filter(re.compile("crease|corner").match, names))
            if not isinstance(faces, slice):
                holes = f"{np.count_nonzero(~faces)} of {len(faces)} of {self.path}"
                self.contents.notes.left_out("faces that are holes", [holes])
            hard_edges = self._hard_edges(mesh, rows, code, is_track="normals" in animated)
            return Surface(None, attributes, tuple(groups), (), materials, images, hard_edges)

    def animated(self, codes: Floats) -> dict[str, StageQuantity]:
        """Return the quantities that are tracks in frames at these time codes, by name in the file.

        Normals and velocities of skinned meshes are skipped, since skinning does not deform them.
        """
        with usd_errors(f"USD cannot read the properties of {self.path}"):
            return {
                quantity.name: quantity
                for quantity in quantities(self.prim)
                if not (self.skin and quantity.to_world) and quantity.is_animated(codes)
            }

    def tracks(
        self, codes: Floats, frames: range, animated: Mapping[str, StageQuantity]
    ) -> Mapping[str, TrackSource]:
        """Return tracks over a range of frames with the same faces, of frames at all `codes`."""
        if not animated:
            return {}
        with usd_errors(f"USD cannot read the properties of {self.path}"):
            for quantity in animated.values():
                self.contents.add(quantity.attribute.GetPrim(), quantity.attribute.GetName())
            is_moving = len(set(self._transform_codes)) > 1
            note_quantities(
                self.path, animated.values(), codes, TOLERANCE, self.contents.notes,
                is_transform_animated=is_moving,
            )  # fmt: skip
            guarded = usd_errors(f"USD cannot read the properties of {self.path}")
            tracks = {
                (quantity.domain, name): replace(quantity, values=guarded(quantity.values))
                for name, quantity in by_track_name(animated).items()
            }
            first = float(codes[frames.start])
            file_mesh = self._file_mesh(first)
            rows, times = self._rows(file_mesh.counts, first), codes[frames.start : frames.stop]
            sizes = file_mesh.n_items, self.frame(first).n_items
            return quantity_tracks(
                self.path, tracks, times, sizes, rows, self._matrix, self.contents.notes, MISFITS
            )

    def _record(self) -> None:
        """Record what its frames are read from."""
        for prim in ancestors(self.prim):
            self.contents.add(prim)
        self.contents.add(self.prim, "points", *FACE_ATTRIBUTES, HOLES, *FACE_SETTINGS)
        for prim in () if self.skin is None else (self.prim, *self.skin.prims):
            names = map(str, prim.GetAuthoredPropertyNames())
            self.contents.add(prim, *filter(SKINNING.match, names))

    @cached_property
    def _shape(self) -> MeshShape:
        return MeshShape(self.prim)

    @property
    def _space(self) -> Any:
        """The prim in whose space its points are, after skinning."""
        return self.prim if self.skin is None else self.skin.space

    @property
    def _transform_codes(self) -> list[float]:
        return self.transforms.codes(self._space)

    def _matrix(self, code: float) -> Floats:
        """Return the matrix to the world at a time code."""
        return self.transforms.world(self._space, code)

    @cached_property
    def _start(self) -> float:
        return float(self.samples.all[0]) if len(self.samples.all) else 0.0

    def _corner_order(self, counts: Integers) -> Any:
        """Return the order in which the corners of all faces are counterclockwise in the world."""
        is_clockwise = self.prim.GetAttribute("orientation").Get() == "leftHanded"
        is_reversed = is_clockwise != is_mirroring(self._matrix(self._start))
        return reversed_corners(counts, keeps_first=True) if is_reversed else slice(None)

    def _file_mesh(self, code: float) -> PolygonMesh:
        """Return all faces at a time code in file order, with points in local space."""
        return self._shape.polygons(self._shape.points(code), code)

    def _rows(self, counts: Integers, code: float) -> dict[Domain, Any]:
        """Return the items in the file of the items of the mesh, to index arrays."""
        rows: dict[Domain, Any] = dict.fromkeys(Domain, slice(None))
        rows[Domain.CORNER] = self._corner_order(counts)
        is_solid = self._shape.solid_faces(len(counts), code)
        if is_solid is not None:
            corners = np.arange(counts.sum())[rows[Domain.CORNER]]
            rows |= {Domain.FACE: is_solid, Domain.CORNER: corners[np.repeat(is_solid, counts)]}
        return rows

    @cached_property
    def _first(self) -> PolygonMesh:
        return self._polygons(self._shape.points(self._start), self._start)

    def _polygons(self, vertices: Vertices, code: float) -> PolygonMesh:
        """Return the faces at a time code, counterclockwise and without holes."""
        mesh = self._shape.polygons(vertices, code)
        rows = self._rows(mesh.counts, code)
        return PolygonMesh(
            vertices, mesh.counts[rows[Domain.FACE]], mesh.corners[rows[Domain.CORNER]]
        )

    def _hard_edges(
        self, mesh: PolygonMesh, rows: dict[Domain, Any], code: float, *, is_track: bool
    ) -> Int32s | None:
        """Return the hard edges implied by its normals; None without normals."""
        order = self._corner_order(mesh.counts)
        full_mesh = replace(mesh, corners=mesh.corners[order])
        quantity = next(
            (quantity for quantity in quantities(self.prim) if quantity.role == NORMALS), None
        )
        if quantity is None:
            return None
        normals = quantity.item_values(code, mesh.n_items[quantity.domain])
        if normals is not None:
            self.contents.add(quantity.attribute.GetPrim(), quantity.attribute.GetName())
            normals = normals[order] if quantity.domain is Domain.CORNER else normals
        corner_normals = normals_of_corners(full_mesh, quantity.domain, normals)
        hard_edges = find_hard_edges(full_mesh, corner_normals)
        self.normal_notes.add(self.path, hard_edges, is_track=is_track)
        if isinstance(rows[Domain.FACE], slice):
            return hard_edges.edges
        counts, corners = full_mesh.counts[rows[Domain.FACE]], mesh.corners[rows[Domain.CORNER]]
        return remaining_edges(hard_edges.edges, counts, corners)
