"""Transforms of an Alembic hierarchy, and world matrices of meshes.

Points are row vectors, as in the file: a point is multiplied by the matrix of the innermost
transform first.
"""

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.alembic.archive import (
    AbcObject,
    Archive,
    Property,
    Times,
    bracketing_samples,
    damage_error,
)
from meshreel.formats.alembic.attributes import (
    NORMALS,
    MeshTracks,
    read_attributes,
    read_face_sets,
    read_normals,
)
from meshreel.formats.alembic.winding import reversed_corners
from meshreel.formats.notes import GatheredNote, describe_cages, note_left_out
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.merging import unite_times
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.scenes.timing import frame_times
from meshreel.formats.surfaces.hard_edges import NormalNotes, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Surface
from meshreel.model.tracks import TrackSource

Matrix = npt.NDArray[np.float64]

SCALE, TRANSLATE, ROTATE, MATRIX, ROTATE_X, ROTATE_Y, ROTATE_Z = range(7)
N_CHANNELS = {
    SCALE: 3, TRANSLATE: 3, ROTATE: 4, MATRIX: 16, ROTATE_X: 1, ROTATE_Y: 1, ROTATE_Z: 1,
}  # fmt: skip
"""Number of channels of each operation; angles are in degrees."""


@dataclass(frozen=True, eq=False)
class Transform:
    """A transform of the hierarchy, possibly animated.

    Parameters
    ----------
    properties : dict
        Contents of its compound ``.xform``: operations, channels, and the inheritance flag.
    """

    properties: dict[str, Property]

    @property
    def times_s(self) -> list[Times]:
        """Sample times of each animated property; empty if the transform is static."""
        properties = (self.properties.get(name) for name in (".vals", ".inherits"))
        return [one.times_s for one in properties if one is not None and not one.is_constant]

    def inherits(self, time_s: float) -> bool:
        """Return whether the parent transforms apply."""
        inherits = self.properties.get(".inherits")
        if inherits is None or inherits.header.n_samples == 0:
            return True
        before, after, weight = bracketing_samples(inherits.times_s, time_s)
        return bool(inherits.numbers(after if weight > 1 / 2 else before).any())

    def matrix(self, time_s: float) -> Matrix:
        """Return the local matrix at a time, interpolated between samples, of shape (4, 4)."""
        values = self.properties.get(".vals")
        if values is None or ".ops" not in self.properties or values.header.n_samples == 0:
            return np.eye(4)
        before, after, weight = bracketing_samples(values.times_s, time_s)
        if weight == 0:
            return self._sample(before)
        return _interpolate(self._sample(before), self._sample(after), weight)

    def _sample(self, index: int) -> Matrix:
        operations = self.properties[".ops"].integers() >> 4
        values = self.properties[".vals"].numbers(index).ravel().astype(np.float64)
        matrix, start = np.eye(4), 0
        for operation in operations.tolist():
            count = N_CHANNELS.get(operation, 0)
            channels = values[start : start + count]
            if not count or len(channels) < count:
                raise damage_error(
                    f"operation {operation} of a transform has {len(channels)} channels"
                )
            matrix = _operation(operation, channels) @ matrix
            start += count
        return matrix


def world_matrix(chain: Sequence[Transform], time_s: float) -> Matrix:
    """Return the world matrix below a chain of transforms, outermost first, of shape (4, 4)."""
    world = np.eye(4)
    for transform in chain:
        own = transform.matrix(time_s)
        world = own @ world if transform.inherits(time_s) else own
    return world


def transform_points(points: Vertices, world: Matrix) -> Vertices:
    """Return transformed points, in their own float type.

    The result is float64 if it is so far from the origin that float32 would move a point by more
    than a millionth of the mesh size.
    """
    linear, shift = world[:3, :3], world[3, :3]
    if (world == np.eye(4)).all():
        return points
    with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
        wide = points.astype(np.float64)
        moved: Vertices = (wide if (linear == np.eye(3)).all() else wide @ linear) + shift
        narrowing = Narrowing()
        narrowing.add(moved)
        is_narrow = points.dtype == np.float32 and narrowing.is_harmless
        return moved.astype(np.float32) if is_narrow else moved


def _operation(operation: int, channels: npt.NDArray[np.float64]) -> Matrix:
    if operation == MATRIX:
        return channels.reshape(4, 4)
    matrix = np.eye(4)
    if operation == SCALE:
        matrix[range(3), range(3)] = channels
    elif operation == TRANSLATE:
        matrix[3, :3] = channels
    elif operation == ROTATE:
        matrix[:3, :3] = _rotation(channels[:3], channels[3])
    else:
        matrix[:3, :3] = _rotation(np.eye(3)[operation - ROTATE_X], channels[0])
    return matrix


def _rotation(axis: npt.NDArray[np.float64], angle_deg: float) -> Matrix:
    """Return the rotation about an axis for row vectors (Rodrigues' formula)."""
    with np.errstate(all="ignore"):
        x, y, z = axis / (np.linalg.norm(axis) or 1.0)
        angle = np.deg2rad(angle_deg)
        cross = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
        turn: Matrix = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
        return turn


def _axis_and_angle(rotation: Matrix) -> tuple[npt.NDArray[np.float64], float]:
    """Return the axis, of any length, and the angle of a rotation for row vectors, in degrees."""
    products = np.empty((4, 4))  # of the quaternion with itself, times 4; its scalar comes first
    products[1:, 1:] = rotation + rotation.T + (1 - np.trace(rotation)) * np.eye(3)
    products[0, 0] = 1 + np.trace(rotation)
    products[0, 1:] = products[1:, 0] = [
        rotation[row, column] - rotation[column, row] for row, column in ((1, 2), (2, 0), (0, 1))
    ]
    quaternion = products[products.diagonal().argmax()]  # the largest one loses no digits
    quaternion = quaternion * np.copysign(1.0, quaternion[0])
    angle = 2 * np.arctan2(np.linalg.norm(quaternion[1:]), quaternion[0])
    return quaternion[1:], float(np.rad2deg(angle))


def _interpolate(first: Matrix, second: Matrix, weight: float) -> Matrix:
    """Return a matrix between two: rotations are interpolated spherically, the rest linearly."""
    blend = (1 - weight) * first + weight * second
    if not np.isfinite(blend).all():
        return blend
    rotations, stretches = zip(*(_polar(one[:3, :3]) for one in (first, second)), strict=True)
    axis, angle_deg = _axis_and_angle(rotations[0].T @ rotations[1])
    rotation = rotations[0] @ _rotation(axis, weight * angle_deg)
    blend[:3, :3] = ((1 - weight) * stretches[0] + weight * stretches[1]) @ rotation
    return blend


def _polar(linear: Matrix) -> tuple[Matrix, Matrix]:
    """Return the polar decomposition, stretch and rotation with stretch @ rotation == linear."""
    left, _, right = np.linalg.svd(linear)
    rotation = left @ right
    if np.linalg.det(rotation) < 0:  # a reflection goes into the stretch
        rotation = -rotation
    return rotation, linear @ rotation.T


POINTS, CORNERS, COUNTS = "P", ".faceIndices", ".faceCounts"

MAX_OBJECTS, MAX_DEPTH = 100_000, 256
"""Limits, since nested instances can make a small file expand to any number of objects."""

POLYGONS, SUBDIVISION, TRANSFORM = "AbcGeom_PolyMesh", "AbcGeom_SubD", "AbcGeom_Xform"
OTHER_SCHEMAS = {
    "AbcGeom_Camera": "cameras",
    "AbcGeom_Curve": "curves",
    "AbcGeom_Light": "lights",
    "AbcGeom_NuPatch": "NURBS patches",
    "AbcGeom_Points": "point clouds",
    "AbcMaterial_Material": "materials",
}
"""Schemas, without their version, of objects that are not read."""


@dataclass(frozen=True, eq=False)
class Node:
    """An object at a path of the hierarchy; several nodes may be instances of one object.

    Attributes
    ----------
    path : str
        Names from the root, such as "/root/body".
    schema : str
        Schema without its version: "AbcGeom_PolyMesh".
    chain : tuple of Transform
        The transforms above it, outermost first.
    """

    path: str
    schema: str
    object: AbcObject
    chain: tuple[Transform, ...]


def read_meshes(path: Path, options: ReadOptions) -> list[SceneMesh]:
    """Return the polygon meshes and subdivision surfaces of an Alembic file, in file order.

    Raises
    ------
    FormatError
        If it is damaged, or contains no mesh; the message lists what it contains.
    """
    nodes = list(walk_hierarchy(Archive(path)))
    meshes = [node for node in nodes if node.schema in (POLYGONS, SUBDIVISION)]
    if not meshes:
        raise FormatError(
            f"contains no mesh, only {describe_contents(nodes)}; export polygon meshes into it"
        )
    if any(node.schema in OTHER_SCHEMAS for node in nodes):
        note_left_out(options.notes, describe_contents(nodes))

    cages, normals = GatheredNote(options.notes, describe_cages), NormalNotes(options.notes)

    def read(node: Node) -> SceneMesh:
        return _AnimatedMesh(node, options.notes, cages, normals).scene_mesh()

    return [read_or_defer_error(node.path, partial(read, node)) for node in meshes]


class _AnimatedMesh:
    """A mesh at its place in the hierarchy.

    Parameters
    ----------
    notes : list of str
        Gains a sentence for everything that is not read.
    cages : GatheredNote
        Collects subdivision surfaces.
    normal_notes : NormalNotes
        Collects meshes with normals.
    """

    def __init__(
        self, node: Node, notes: list[str], cages: GatheredNote, normal_notes: NormalNotes
    ) -> None:
        self._node, self._notes, self._cages = node, notes, cages
        self._normal_notes = normal_notes
        geometry = node.object.properties.get(".geom")
        self._properties = geometry.properties if geometry is not None else {}
        missing = [one for one in (POINTS, CORNERS, COUNTS) if one not in self._properties]
        if missing:
            raise damage_error(f"the mesh {node.path} has no {', '.join(missing)}")
        self._points, self._corners, self._counts = (
            self._properties[name] for name in (POINTS, CORNERS, COUNTS)
        )
        self._animated = MeshTracks(node.path, self._properties, notes)
        self._times_s = self._sample_times()
        self._cached_faces: tuple[Hashable, PolygonMesh] | None = None

    def scene_mesh(self) -> SceneMesh:
        """Return the mesh as the format-independent representation of a scene mesh."""
        sampling, fps = self._points.sampling, None
        if len(self._times_s) == 1 and sampling.is_uniform and self._points.header.sampling:
            fps = frame_times(sampling.times(2)).fps  # one sample alone has no frame rate
        return SceneMesh(
            self._node.path, self._times_s, self._frame, self._surface, fps, self._tracks
        )

    def _sample_times(self) -> Times:
        """Return the times at which points, faces or transforms change, or else tracks do."""
        own = (self._points, self._corners, self._counts)
        above = (one for transform in self._node.chain for one in transform.times_s)
        times = unite_times([*(one.times_s for one in own), *above])
        return times if len(times) > 1 else unite_times([times, *self._animated.times_s])

    def _frame(self, index: int) -> PolygonMesh:
        time_s = float(self._times_s[index])
        points = self._points_at(time_s)
        faces = self._faces_at(time_s, points)
        return PolygonMesh(
            transform_points(points, self._world(time_s)), faces.counts, faces.corners
        )

    def _tracks(self, frames: range) -> Mapping[str, TrackSource]:
        times = self._times_s[frames.start : frames.stop]
        first = float(times[0])
        mesh = self._faces_at(first, self._points_at(first))
        return self._animated.tracks(
            times,
            mesh,
            self._world,
            self._times_s,
            is_transform_animated=self._is_transform_animated,
        )

    @cached_property
    def _is_transform_animated(self) -> bool:
        return any(transform.times_s for transform in self._node.chain)

    def _world(self, time_s: float) -> Matrix:
        if self._is_transform_animated:
            return world_matrix(self._node.chain, time_s)
        return self._static_world

    @cached_property
    def _static_world(self) -> Matrix:
        """The world matrix if no transform is animated."""
        return world_matrix(self._node.chain, float(self._times_s[0]))

    def _points_at(self, time_s: float) -> Vertices:
        before, after, weight = bracketing_samples(self._points.times_s, time_s)
        first = _positions(self._points.numbers(before), self._node.path)
        if weight == 0:
            return first
        second = _positions(self._points.numbers(after), self._node.path)
        if len(second) != len(first):
            return first
        with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
            blend = (1 - weight) * first.astype(np.float64) + weight * second
            return blend.astype(np.float32) if first.dtype == np.float32 else blend

    def _faces_at(self, time_s: float, points: Vertices) -> PolygonMesh:
        """Return the validated faces at a time, cached until they change.

        The vertices of the result may be of an earlier time with the same faces.
        """
        corners, counts = (_sample_index(one, time_s) for one in (self._corners, self._counts))
        key = self._corners.stored_index(corners), self._counts.stored_index(counts), len(points)
        cached = self._cached_faces
        if cached is None or cached[0] != key:
            mesh = _counterclockwise_mesh(
                points, self._counts.integers(counts), self._corners.integers(corners)
            )
            cached = self._cached_faces = key, mesh
        return cached[1]

    def _surface(self, index: int) -> Surface:
        time_s = float(self._times_s[index])
        points = self._points_at(time_s)
        mesh = replace(self._faces_at(time_s, points), vertices=points)
        animated = self._animated.properties
        surface = read_attributes(self._properties, mesh, time_s, self._notes, animated)
        normals, hard_edges = read_normals(self._properties, mesh, time_s), None
        if normals is not None:
            normal_edges = find_hard_edges(mesh, normals)
            self._normal_notes.add(self._node.path, normal_edges, is_track=NORMALS in animated)
            hard_edges = normal_edges.edges
        if "visible" in self._node.object.properties:
            note_left_out(self._notes, f"visibility of {self._node.path}")
        if self._node.schema == SUBDIVISION:
            self._cages.add(self._node.path)
        sets = {
            child.header.name: child.properties[".faceset"].properties
            for child in self._node.object.children
            if ".faceset" in child.properties
        }
        materials = read_face_sets(sets, len(mesh.counts), time_s)
        return replace(surface, groups=(*materials, *surface.groups), hard_edges=hard_edges)


def walk_hierarchy(archive: Archive) -> Iterator[Node]:
    """Yield every object of a file in file order, with the source of an instance at each instance.

    Raises
    ------
    FormatError
        If two objects have the same path, the source of an instance is missing or contains the
        instance, or there are too many objects.
    """
    seen: set[str] = set()
    root = Node("", "", archive.top, ())
    stack = [
        (one, root, frozenset({archive.top.reference})) for one in _reversed_children(archive.top)
    ]
    while stack:
        child, parent, ancestors = stack.pop()
        path = f"{parent.path}/{child.header.name}"
        if path in seen:
            raise damage_error(f"two objects have the path {path}")
        seen.add(path)
        if len(seen) > MAX_OBJECTS:
            raise FormatError(f"contains more than {MAX_OBJECTS} objects; export fewer of them")
        source = _source(archive, child, path) if child.header.is_instance else child
        if source.reference in ancestors:
            raise damage_error(f"{path} contains itself")
        if len(ancestors) > MAX_DEPTH:
            raise FormatError(f"nests {path} below more than {MAX_DEPTH} objects; flatten it")
        node = Node(path, _schema_name(source), source, parent.chain)
        yield node
        if node.schema == TRANSFORM and ".xform" in source.properties:
            transform = Transform(source.properties[".xform"].properties)
            node = Node(path, node.schema, source, (*parent.chain, transform))
        stack += [(one, node, ancestors | {source.reference}) for one in _reversed_children(source)]


def describe_contents(nodes: Sequence[Node]) -> str:
    """Return the contents of a file without meshes in words: "cameras (2), curves (1)"."""
    counts = Counter(OTHER_SCHEMAS[node.schema] for node in nodes if node.schema in OTHER_SCHEMAS)
    listed = [f"{what} ({count})" for what, count in sorted(counts.items())]
    return ", ".join(listed) or ("only transforms" if nodes else "no objects")


def _reversed_children(parent: AbcObject) -> list[AbcObject]:
    return parent.children[::-1]


def _schema_name(source: AbcObject) -> str:
    return source.header.schema.rpartition("_v")[0]


def _source(archive: Archive, instance: AbcObject, path: str) -> AbcObject:
    """Return the object of which an instance is a copy."""
    source_property = instance.properties.get(".instanceSource")
    source_path = "".join(source_property.texts()[:1]) if source_property is not None else ""
    source: AbcObject | None = archive.top
    for name in source_path.strip("/").split("/"):
        children = source.children if source is not None else []
        source = next((one for one in children if one.header.name == name), None)
    if source is None or source.header.is_instance:
        raise damage_error(f"{path} is an instance of {source_path!r}, which does not exist")
    return source


def _sample_index(values: Property, time_s: float) -> int:
    """Return the index of the sample in effect at a time."""
    return bracketing_samples(values.times_s, time_s)[0]


def _positions(points: npt.NDArray[Any], path: str) -> Vertices:
    if points.dtype.kind != "f" or points.shape[1] != 3:
        raise damage_error(f"the points of {path} are {points.shape[1]} x {points.dtype}")
    positions: Vertices = points.astype(np.promote_types(points.dtype, np.float32), copy=False)
    return positions


def _counterclockwise_mesh(
    points: Vertices, counts: npt.NDArray[np.int64], corners: npt.NDArray[np.int64]
) -> PolygonMesh:
    total = int(counts.sum())
    if total != len(corners) or (counts < 0).any():
        raise damage_error(f"its face sizes add up to {total} corners, but it has {len(corners)}")
    return polygon_mesh(points, counts, corners[reversed_corners(counts)])
