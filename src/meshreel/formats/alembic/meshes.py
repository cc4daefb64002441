"""The meshes of an Alembic file."""

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.alembic.archive import AbcObject, Archive, Property
from meshreel.formats.alembic.attributes import (
    NORMALS,
    read_attributes,
    read_face_sets,
    read_normals,
)
from meshreel.formats.alembic.ogawa import damaged
from meshreel.formats.alembic.time_sampling import Times, between
from meshreel.formats.alembic.track_reading import MeshTracks
from meshreel.formats.alembic.transforms import Matrix, Transform, placed, world_matrix
from meshreel.formats.alembic.winding import turned_corners
from meshreel.formats.notes import GatheredNote, describe_cages, note_left_out
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.merging import united_times
from meshreel.formats.scenes.scene_mesh import SceneMesh, readable_mesh
from meshreel.formats.scenes.timing import frame_times
from meshreel.formats.surfaces.hard_edges import NormalNotes, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Surface
from meshreel.model.tracks import TrackSource

POINTS, CORNERS, COUNTS = "P", ".faceIndices", ".faceCounts"

MAX_OBJECTS, MAX_DEPTH = 100_000, 256
"""Instances of instances can make any number of objects of a small file."""

POLYGONS, SUBDIVISION, TRANSFORM = "AbcGeom_PolyMesh", "AbcGeom_SubD", "AbcGeom_Xform"

OTHERS = {
    "AbcGeom_Camera": "cameras",
    "AbcGeom_Curve": "curves",
    "AbcGeom_Light": "lights",
    "AbcGeom_NuPatch": "NURBS patches",
    "AbcGeom_Points": "point clouds",
    "AbcMaterial_Material": "materials",
}
"""Kinds of objects, by their schema without its version."""


@dataclass(frozen=True, eq=False)
class Node:
    """An object in its place; several may be instances of one object.

    Attributes
    ----------
    path : str
        Names from the top, such as "/root/body".
    schema : str
        What it is, without the version: "AbcGeom_PolyMesh".
    object : AbcObject
    chain : tuple of Transform
        The transforms above it, the outermost first.
    """

    path: str
    schema: str
    object: AbcObject
    chain: tuple[Transform, ...]


def read_meshes(path: Path, options: ReadOptions) -> list[SceneMesh]:
    """The polygon meshes and subdivision surfaces of an Alembic file, in its order.

    Raises
    ------
    FormatError
        If it is damaged, or holds none; then what it holds is named.
    """
    nodes = list(walk(Archive(path)))
    meshes = [node for node in nodes if node.schema in (POLYGONS, SUBDIVISION)]
    if not meshes:
        raise FormatError(
            f"holds no mesh, but {describe_contents(nodes)}; export polygon meshes into it"
        )
    if any(node.schema in OTHERS for node in nodes):
        note_left_out(options.notes, describe_contents(nodes))

    cages, normals = GatheredNote(options.notes, describe_cages), NormalNotes(options.notes)

    def read(node: Node) -> SceneMesh:
        return _AnimatedMesh(node, options.notes, cages, normals).scene_mesh()

    return [readable_mesh(node.path, partial(read, node)) for node in meshes]


class _AnimatedMesh:
    """A mesh of a file, in its place in the hierarchy.

    Parameters
    ----------
    node : Node
    notes : list of str
        Gains a sentence for what is not carried.
    cages : GatheredNote
        Told of a subdivision surface.
    normal_notes : NormalNotes
        Told of a mesh with normals.
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
            raise damaged(f"the mesh {node.path} has no {', '.join(missing)}")
        self._points, self._corners, self._counts = (
            self._properties[name] for name in (POINTS, CORNERS, COUNTS)
        )
        self._carried = MeshTracks(node.path, self._properties, notes)
        self._times_s = self._sample_times()
        self._known: tuple[Hashable, PolygonMesh] | None = None

    def scene_mesh(self) -> SceneMesh:
        """The mesh as the rest of the package takes it."""
        sampling, fps = self._points.sampling, None
        if len(self._times_s) == 1 and sampling.is_uniform and self._points.header.sampling:
            fps = frame_times(sampling.times(2)).fps  # a single frame says no rate otherwise
        return SceneMesh(
            self._node.path, self._times_s, self._frame, self._surface, fps, self._tracks
        )

    def _sample_times(self) -> Times:
        """When points, faces or a transform above change; if none does, what the mesh carries."""
        own = (self._points, self._corners, self._counts)
        above = (one for transform in self._node.chain for one in transform.times_s)
        times = united_times([*(one.times_s for one in own), *above])
        return times if len(times) > 1 else united_times([times, *self._carried.times_s])

    def _frame(self, index: int) -> PolygonMesh:
        time_s = float(self._times_s[index])
        points = self._points_at(time_s)
        faces = self._faces_at(time_s, points)
        return PolygonMesh(placed(points, self._world(time_s)), faces.counts, faces.corners)

    def _tracks(self, frames: range) -> Mapping[str, TrackSource]:
        times = self._times_s[frames.start : frames.stop]
        first = float(times[0])
        mesh = self._faces_at(first, self._points_at(first))
        return self._carried.tracks(
            times, mesh, self._world, self._times_s, is_moved=self._is_moved
        )

    @cached_property
    def _is_moved(self) -> bool:
        return any(transform.times_s for transform in self._node.chain)

    def _world(self, time_s: float) -> Matrix:
        return world_matrix(self._node.chain, time_s) if self._is_moved else self._still_world

    @cached_property
    def _still_world(self) -> Matrix:
        """The matrix at all times, if no transform moves."""
        return world_matrix(self._node.chain, float(self._times_s[0]))

    def _points_at(self, time_s: float) -> Vertices:
        before, after, share = between(self._points.times_s, time_s)
        first = _positions(self._points.numbers(before), self._node.path)
        if share == 0:
            return first
        second = _positions(self._points.numbers(after), self._node.path)
        if len(second) != len(first):
            return first
        with np.errstate(all="ignore"):  # what is not finite is reported when frames are checked
            blend = (1 - share) * first.astype(np.float64) + share * second
            return blend.astype(np.float32) if first.dtype == np.float32 else blend

    def _faces_at(self, time_s: float, points: Vertices) -> PolygonMesh:
        """The faces, checked when they change; the vertices are not those of this time."""
        corners, counts = (_sample(one, time_s) for one in (self._corners, self._counts))
        key = self._corners.stored(corners), self._counts.stored(counts), len(points)
        known = self._known
        if known is None or known[0] != key:
            found = _counter_clockwise(
                points, self._counts.whole_numbers(counts), self._corners.whole_numbers(corners)
            )
            known = self._known = key, found
        return known[1]

    def _surface(self, index: int) -> Surface:
        time_s = float(self._times_s[index])
        points = self._points_at(time_s)
        mesh = replace(self._faces_at(time_s, points), vertices=points)
        moving = self._carried.moving
        surface = read_attributes(self._properties, mesh, time_s, self._notes, moving)
        normals, hard_edges = read_normals(self._properties, mesh, time_s), None
        if normals is not None:
            found = find_hard_edges(mesh, normals)
            self._normal_notes.add(self._node.path, found, is_track=NORMALS in moving)
            hard_edges = found.edges
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


def _sample(found: Property, time_s: float) -> int:
    """The sample that holds at a time."""
    return between(found.times_s, time_s)[0]


def _positions(points: npt.NDArray[Any], path: str) -> Vertices:
    if points.dtype.kind != "f" or points.shape[1] != 3:
        raise damaged(f"the points of {path} are {points.shape[1]} numbers of {points.dtype}")
    found: Vertices = points.astype(np.promote_types(points.dtype, np.float32), copy=False)
    return found


def _counter_clockwise(
    points: Vertices, counts: npt.NDArray[np.int64], corners: npt.NDArray[np.int64]
) -> PolygonMesh:
    total = int(counts.sum())
    if total != len(corners) or (counts < 0).any():
        raise damaged(f"its faces have {total} corners, of which {len(corners)} are there")
    return polygon_mesh(points, counts, corners[turned_corners(counts)])


def walk(archive: Archive) -> Iterator[Node]:
    """Every object of a file, in its order; what an instance stands for once for each.

    Raises
    ------
    FormatError
        If two objects have one path, an instance stands for what is not there, or for itself, or
        there are too many.
    """
    seen: set[str] = set()
    top = Node("", "", archive.top, ())
    waiting = [(one, top, frozenset({archive.top.reference})) for one in _below(archive.top)]
    while waiting:
        child, parent, above = waiting.pop()
        path = f"{parent.path}/{child.header.name}"
        if path in seen:
            raise damaged(f"it has two objects {path}")
        seen.add(path)
        if len(seen) > MAX_OBJECTS:
            raise FormatError(f"holds more than {MAX_OBJECTS} objects; export fewer of them")
        found = _source(archive, child, path) if child.header.is_instance else child
        if found.reference in above:
            raise damaged(f"{path} is below itself")
        if len(above) > MAX_DEPTH:
            raise FormatError(f"has {path} below more than {MAX_DEPTH} objects; export it flatter")
        node = Node(path, _kind(found), found, parent.chain)
        yield node
        if node.schema == TRANSFORM and ".xform" in found.properties:
            transform = Transform(found.properties[".xform"].properties)
            node = Node(path, node.schema, found, (*parent.chain, transform))
        waiting += [(one, node, above | {found.reference}) for one in _below(found)]


def describe_contents(nodes: Sequence[Node]) -> str:
    """The objects of a file without a mesh, in words: "cameras (2), curves (1)"."""
    counts = Counter(OTHERS[node.schema] for node in nodes if node.schema in OTHERS)
    listed = [f"{what} ({count})" for what, count in sorted(counts.items())]
    return ", ".join(listed) or ("only transforms" if nodes else "no objects")


def _below(found: AbcObject) -> list[AbcObject]:
    return found.children[::-1]


def _kind(found: AbcObject) -> str:
    return found.header.schema.rpartition("_v")[0]


def _source(archive: Archive, instance: AbcObject, path: str) -> AbcObject:
    """The object that an instance stands for."""
    named = instance.properties.get(".instanceSource")
    wanted = "".join(named.texts()[:1]) if named is not None else ""
    source: AbcObject | None = archive.top
    for name in wanted.strip("/").split("/"):
        children = source.children if source is not None else []
        source = next((one for one in children if one.header.name == name), None)
    if source is None or source.header.is_instance:
        raise damaged(f"{path} is an instance of {wanted!r}, which is not there")
    return source
