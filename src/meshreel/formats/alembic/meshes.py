"""Reading the meshes of an Alembic file, in world space.

Points are row vectors, as in the file: a point is multiplied by the matrix of the innermost
transform first.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from meshreel.arrays import Floats, Integers
from meshreel.errors import FormatError
from meshreel.formats.alembic.archive import AbcObject, Archive, Property, damage_error
from meshreel.formats.alembic.attributes import (
    MISFITS,
    NORMALS,
    animated_quantities,
    domain_of,
    note_unread,
    read_attributes,
    read_face_sets,
    read_normals,
)
from meshreel.formats.frames.field_tracks import Key
from meshreel.formats.options import Reading
from meshreel.formats.scenes.quantities import Quantity, note_quantities, quantity_tracks
from meshreel.formats.scenes.scene_mesh import (
    SHOWN,
    SceneMesh,
    Visibility,
    read_or_defer_error,
)
from meshreel.formats.scenes.timing import blend, neighbors, unite_times
from meshreel.formats.scenes.transforms import transform_points
from meshreel.formats.surfaces.hard_edges import NormalNotes, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh, reversed_corners
from meshreel.model.notes import CAGES, Notes
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain, Surface
from meshreel.model.timing import rounded_rate
from meshreel.model.tracks import TrackSource

SCALE, TRANSLATE, ROTATE, MATRIX, ROTATE_X, ROTATE_Y, ROTATE_Z = range(7)
N_CHANNELS = {
    SCALE: 3, TRANSLATE: 3, ROTATE: 4, MATRIX: 16, ROTATE_X: 1, ROTATE_Y: 1, ROTATE_Z: 1,
}  # fmt: skip
"""Number of channels of each operation; angles are in degrees."""


@dataclass(frozen=True, eq=False)
class Transform:
    """A transform of the hierarchy, possibly animated."""

    properties: dict[str, Property]
    """Contents of its compound ``.xform``: operations, channels, and the inheritance flag."""

    @property
    def animated(self) -> list[Property]:
        """The animated properties; empty if the transform is static."""
        properties = (self.properties.get(name) for name in (".vals", ".inherits"))
        return [values for values in properties if values is not None and not values.is_constant]

    def inherits(self, time_s: float) -> bool:
        """Return whether the parent transforms apply."""
        inherits = self.properties.get(".inherits")
        if inherits is None or inherits.n_samples == 0:
            return True
        before, after, weight = neighbors(inherits.times_s, time_s)
        return bool(inherits.numbers(after if weight > 1 / 2 else before).any())

    def matrix(self, time_s: float) -> Floats:
        """Return the local matrix at a time, interpolated between samples, of shape (4, 4)."""
        values = self.properties.get(".vals")
        if values is None or ".ops" not in self.properties or values.n_samples == 0:
            return np.eye(4)
        before, after, weight = neighbors(values.times_s, time_s)
        if weight == 0:
            return self._sample_matrix(before)
        return _interpolate(self._sample_matrix(before), self._sample_matrix(after), weight)

    def _sample_matrix(self, index: int) -> Floats:
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


def world_matrix(chain: Sequence[Transform], time_s: float) -> Floats:
    """Return the world matrix below a chain of transforms, outermost first, of shape (4, 4)."""
    world = np.eye(4)
    for transform in chain:
        local = transform.matrix(time_s)
        world = local @ world if transform.inherits(time_s) else local
    return world


def _operation(operation: int, channels: Floats) -> Floats:
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


def _rotation(axis: Floats, angle_deg: float) -> Floats:
    """Return the rotation about an axis for row vectors (Rodrigues' formula)."""
    with np.errstate(all="ignore"):
        x, y, z = axis / (np.linalg.norm(axis) or 1.0)
        angle = np.deg2rad(angle_deg)
        cross = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
        rotation: Floats = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
        return rotation


def _axis_and_angle(rotation: Floats) -> tuple[Floats, float]:
    """Return the axis, of any length, and the angle of a rotation for row vectors, in degrees."""
    products = np.empty((4, 4))  # of the quaternion with itself, times 4; its scalar comes first
    products[1:, 1:] = rotation + rotation.T + (1 - np.trace(rotation)) * np.eye(3)
    products[0, 0] = 1 + np.trace(rotation)
    products[0, 1:] = products[1:, 0] = [
        rotation[row, column] - rotation[column, row] for row, column in ((1, 2), (2, 0), (0, 1))
    ]
    quaternion = products[products.diagonal().argmax()]  # the largest row is the most precise
    quaternion = quaternion * np.copysign(1.0, quaternion[0])
    angle = 2 * np.arctan2(np.linalg.norm(quaternion[1:]), quaternion[0])
    return quaternion[1:], float(np.rad2deg(angle))


def _interpolate(first: Floats, second: Floats, weight: float) -> Floats:
    """Return a matrix between two: rotations are interpolated spherically, the rest linearly."""
    matrix = (1 - weight) * first + weight * second
    if not np.isfinite(matrix).all():
        return matrix
    rotations, stretches = zip(*(_polar(matrix[:3, :3]) for matrix in (first, second)), strict=True)
    axis, angle_deg = _axis_and_angle(rotations[0].T @ rotations[1])
    rotation = rotations[0] @ _rotation(axis, weight * angle_deg)
    matrix[:3, :3] = ((1 - weight) * stretches[0] + weight * stretches[1]) @ rotation
    return matrix


def _polar(linear: Floats) -> tuple[Floats, Floats]:
    """Return the polar decomposition, stretch and rotation with stretch @ rotation == linear."""
    left, _, right = np.linalg.svd(linear)
    rotation = left @ right
    if np.linalg.det(rotation) < 0:  # a reflection goes into the stretch
        rotation = -rotation
    return rotation, linear @ rotation.T


POINTS, CORNERS, COUNTS = "P", ".faceIndices", ".faceCounts"

MAX_OBJECTS, MAX_DEPTH = 100_000, 256
"""Limits, since nested instances can make a small file expand to any number of objects."""

VISIBLE, DEFERRED, HIDDEN = "visible", -1, 0
"""Property of an object that may be hidden, and two of its states; 1 is visible."""

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
    """An object at a path of the hierarchy; several nodes may be instances of one object."""

    path: str
    """Names from the root, such as "/root/body"."""
    object: AbcObject
    parent: "Node | None" = None

    @property
    def ancestors(self) -> list[AbcObject]:
        """The objects above it, outermost first, without the root."""
        above, node = list[AbcObject](), self.parent
        while node is not None and node.path:
            above.insert(0, node.object)
            node = node.parent
        return above

    @cached_property
    def chain(self) -> tuple[Transform, ...]:
        """The transforms above it, outermost first."""
        transforms = (above for above in self.ancestors if above.schema == TRANSFORM)
        properties = (above.properties.get(".xform") for above in transforms)
        return tuple(Transform(xform.properties) for xform in properties if xform is not None)

    @property
    def visibility(self) -> Visibility:
        """When it is shown: at its own state or, if that is deferred, at that of the next above."""
        states = [
            (visible.times_s, _states(visible))
            for item in (self.object, *reversed(self.ancestors))
            if (visible := item.properties.get(VISIBLE)) is not None and visible.n_samples
        ]
        if not states:
            return SHOWN
        times_s = unite_times([times_s for times_s, _ in states])
        state = np.full(len(times_s), DEFERRED)
        for own_times_s, own_states in states:
            own = own_states[np.maximum(np.searchsorted(own_times_s, times_s, "right") - 1, 0)]
            state = np.where(state == DEFERRED, own, state)
        return Visibility(times_s, state != HIDDEN)


def _states(visible: Property) -> Integers:
    """Return the state at each of its times; samples that share their data are read once."""
    references = [visible.reference_of(index) for index in range(len(visible.times_s))]
    first = {reference: index for index, reference in reversed([*enumerate(references)])}
    states = {ref: [*visible.integers(index).tolist(), DEFERRED][0] for ref, index in first.items()}
    return np.array([states[reference] for reference in references])


def read_meshes(path: Path, reading: Reading) -> list[SceneMesh]:
    """Return the polygon meshes and subdivision surfaces of an Alembic file, in file order.

    Raises
    ------
    FormatError
        If it is damaged, or contains no mesh; the message lists what it contains.
    """
    nodes = list(walk_hierarchy(Archive(path)))
    meshes = [node for node in nodes if node.object.schema in (POLYGONS, SUBDIVISION)]
    if not meshes:
        schemas = (node.object.schema for node in nodes)
        counts = Counter(OTHER_SCHEMAS[schema] for schema in schemas if schema in OTHER_SCHEMAS)
        others = ", ".join(f"{noun} ({count})" for noun, count in sorted(counts.items()))
        contents = others or ("transforms" if nodes else "no objects")
        raise FormatError(f"contains no mesh, only {contents}; export polygon meshes into it")
    parents, mesh_nodes = {node.parent for node in nodes}, {*meshes}
    names = defaultdict[str, list[str]](list)
    for node in nodes:
        is_part = node in mesh_nodes or node in parents or node.parent in mesh_nodes
        if not is_part or node.object.schema in OTHER_SCHEMAS:
            noun = "transforms" if node.object.schema == TRANSFORM else "objects"
            subject = OTHER_SCHEMAS.get(node.object.schema, f"{noun} without a mesh")
            names[subject].append(node.path)
    for subject in sorted(names):
        reading.notes.left_out(subject, names[subject])
    note_unread([nodes[0].object.archive.top], reading.notes)

    normals = NormalNotes(reading.notes)

    def read(node: Node) -> SceneMesh:
        return _AnimatedMesh(node, reading.notes, normals).scene_mesh()

    return [read_or_defer_error(node.path, partial(read, node)) for node in meshes]


class _AnimatedMesh:
    """A mesh at a path of the hierarchy.

    Parameters
    ----------
    notes : Notes
        Gains a sentence for everything that is not read.
    normal_notes : NormalNotes
        Collects meshes with normals.
    """

    def __init__(self, node: Node, notes: Notes, normal_notes: NormalNotes) -> None:
        self._node, self._notes = node, notes
        self._normal_notes = normal_notes
        geometry = node.object.properties.get(".geom")
        self._properties = geometry.properties if geometry is not None else {}
        missing = [name for name in (POINTS, CORNERS, COUNTS) if name not in self._properties]
        if missing:
            raise damage_error(f"the mesh {node.path} has no {', '.join(missing)}")
        self._points, self._corners, self._counts = (
            self._properties[name] for name in (POINTS, CORNERS, COUNTS)
        )
        self._cached_faces: tuple[tuple[int, ...], PolygonMesh] | None = None
        self._transform_times = [
            values.times_s for transform in node.chain for values in transform.animated
        ]
        geometry_times = (values.times_s for values in (self._points, self._corners, self._counts))
        self._times_s = unite_times([*geometry_times, *self._transform_times])
        if len(self._times_s) < 2:  # then tracks determine the frames
            times = (quantity.times() for quantity in self._animated.values())
            self._times_s = unite_times([self._times_s, *times])

    def scene_mesh(self) -> SceneMesh:
        """Return the mesh in the format-independent representation."""
        animated = (values for transform in self._node.chain for values in transform.animated)
        samplings = [
            values.sampling for values in (self._points, *animated) if values.sampling_index
        ]
        rates = {
            rounded_rate(1 / sampling.cycle_s, 1e-12)
            for sampling in samplings
            if sampling.cycle_s and len(sampling.stored_times_s) == 1
        }
        fps = rates.pop() if len(rates) == 1 else None
        node = self._node.object
        face_sets = (child for child in node.children if ".faceset" in child.properties)
        objects = [node, *face_sets, *self._node.ancestors]
        return SceneMesh(
            self._node.path, self._times_s, self._frame, self._surface, fps, self._tracks,
            visibility=self._node.visibility,
            note_unread=partial(note_unread, objects, self._notes),
        )  # fmt: skip

    @cached_property
    def _animated(self) -> dict[str, Quantity]:
        """The animated properties, by property name."""
        return animated_quantities(self._node.path, self._properties, self._notes)

    def _frame(self, index: int) -> PolygonMesh:
        time_s = float(self._times_s[index])
        mesh = self._mesh_at(time_s)
        return replace(mesh, vertices=transform_points(mesh.vertices, self._world(time_s)))

    def _surface(self, index: int) -> Surface:
        node, time_s = self._node, float(self._times_s[index])
        mesh = self._mesh_at(time_s)
        surface = read_attributes(self._properties, mesh, time_s, self._animated)
        normals, hard_edges = read_normals(self._properties, mesh, time_s), None
        if normals is not None:
            normal_edges = find_hard_edges(mesh, normals)
            self._normal_notes.add(node.path, normal_edges, is_track=NORMALS in self._animated)
            hard_edges = normal_edges.edges
        if node.object.schema == SUBDIVISION:
            self._notes.left_out(CAGES, [node.path])
        face_sets = {
            child.name: child.properties[".faceset"].properties
            for child in node.object.children
            if ".faceset" in child.properties
        }
        materials = read_face_sets(face_sets, len(mesh.counts), time_s)
        return replace(surface, groups=(*materials, *surface.groups), hard_edges=hard_edges)

    def _tracks(self, frames: range) -> Mapping[str, TrackSource]:
        if not self._animated:
            return {}
        path, notes = self._node.path, self._notes
        interval_s = float(self._times_s[-1] - self._times_s[0]) / max(1, len(self._times_s) - 1)
        note_quantities(
            path, self._animated.values(), self._times_s, 1e-3 * interval_s, notes,
            is_transform_animated=bool(self._transform_times),
        )  # fmt: skip
        times = self._times_s[frames.start : frames.stop]
        mesh = self._mesh_at(float(times[0]))
        quantities: dict[Key, Quantity] = {}
        for quantity in self._animated.values():
            if (domain := _fitting_domain(quantity, times, mesh)) is None:
                notes.left_out(MISFITS, [quantity.name])
            else:
                quantities[domain, quantity.name] = quantity
        rows = {**dict.fromkeys(Domain, slice(None)), Domain.CORNER: reversed_corners(mesh.counts)}
        sizes = mesh.n_items, mesh.n_items
        return quantity_tracks(path, quantities, times, sizes, rows, self._world, notes, MISFITS)

    def _world(self, time_s: float) -> Floats:
        return world_matrix(self._node.chain, time_s) if self._transform_times else self._static

    @cached_property
    def _static(self) -> Floats:
        """The world matrix if no transform is animated."""
        return world_matrix(self._node.chain, float(self._times_s[0]))

    def _positions(self, index: int) -> Vertices:
        points = self._points.numbers(index)
        if points.dtype.kind != "f" or points.shape[1] != 3:
            raise damage_error(
                f"the points of {self._node.path} are {points.shape[1]} x {points.dtype}"
            )
        positions: Vertices = points.astype(np.promote_types(points.dtype, np.float32), copy=False)
        return positions

    def _mesh_at(self, time_s: float) -> PolygonMesh:
        """Return the mesh at a time in local space; its faces are validated once."""
        before, after, weight = neighbors(self._points.times_s, time_s)
        points = self._positions(before)
        if weight != 0:
            later_points = self._positions(after)
            if len(later_points) == len(points):
                points = blend(points, later_points, weight)

        cached = self._cached_faces
        properties = self._counts, self._corners
        samples = [neighbors(values.times_s, time_s).before for values in properties]
        indices = [
            values.stored_index(sample) for values, sample in zip(properties, samples, strict=True)
        ]
        key = (*indices, len(points))
        if cached is None or cached[0] != key:
            pairs = zip(properties, samples, strict=True)
            counts, corners = (values.integers(sample) for values, sample in pairs)
            total = int(counts.sum())
            if total != len(corners) or (counts < 0).any():
                raise damage_error(
                    f"its face sizes add up to {total} corners, but it has {len(corners)}"
                )
            mesh = polygon_mesh(points, counts, corners[reversed_corners(counts)])
            cached = self._cached_faces = key, mesh
        return replace(cached[1], vertices=points)


def _fitting_domain(quantity: Quantity, times: Floats, mesh: PolygonMesh) -> Domain | None:
    """Return the domain whose items match the values of a property at some time, or None."""
    for time_s in times.tolist():
        values = quantity.values(time_s)
        domain = None if values is None else domain_of(quantity.domain, len(values), mesh)
        if domain is not None:
            return domain
    return None


def walk_hierarchy(archive: Archive) -> Iterator[Node]:
    """Yield every object of a file in file order; at an instance, its source object.

    Raises
    ------
    FormatError
        If two objects have the same path, the source of an instance is missing or contains the
        instance, or there are too many objects.
    """
    seen: set[str] = set()
    root = Node("", archive.top)
    stack = [
        (child, root, frozenset({archive.top.reference})) for child in archive.top.children[::-1]
    ]
    while stack:
        child, parent, ancestors = stack.pop()
        path = f"{parent.path}/{child.name}"
        if path in seen:
            raise damage_error(f"two objects have the path {path}")
        seen.add(path)
        if len(seen) > MAX_OBJECTS:
            raise FormatError(f"contains more than {MAX_OBJECTS} objects; export fewer of them")
        source = _source(archive, child, path) if child.is_instance else child
        if source.reference in ancestors:
            raise damage_error(f"{path} contains itself")
        if len(ancestors) > MAX_DEPTH:
            raise FormatError(f"nests {path} below more than {MAX_DEPTH} objects; flatten it")
        yield (node := Node(path, source, parent))
        above = ancestors | {source.reference}
        stack += [(child, node, above) for child in source.children[::-1]]


def _source(archive: Archive, instance: AbcObject, path: str) -> AbcObject:
    """Return the source object of an instance."""
    source_property = instance.properties.get(".instanceSource")
    source_path = "".join(source_property.texts()[:1]) if source_property is not None else ""
    source: AbcObject | None = archive.top
    for name in source_path.strip("/").split("/"):
        children = source.children if source is not None else []
        source = next((child for child in children if child.name == name), None)
    if source is None or source.is_instance:
        raise damage_error(f"{path} is an instance of {source_path!r}, which does not exist")
    return source
