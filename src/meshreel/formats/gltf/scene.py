"""The scene of a glTF file: the meshes at its nodes, their skins and instances."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.gltf.animation import Nodes, compose, unit
from meshreel.formats.gltf.document import INSTANCING, Document, JsonObject
from meshreel.formats.gltf.geometry import (
    Geometry,
    Matrices,
    has_joints,
    reversed_triangles,
    triangle_primitives,
)
from meshreel.model.geometry.hard_edges import merged_edges
from meshreel.model.notes import Notes, listed
from meshreel.model.surface import Attribute, Domain, Surface

INSTANCE_DEFAULTS: dict[str, tuple[int, ...]] = {
    "TRANSLATION": (0, 0, 0),
    "ROTATION": (0, 0, 0, 1),
    "SCALE": (1, 1, 1),
}
"""Attributes that transform instances, and their defaults."""

INSTANCE_BYTES = 512
"""Memory per transform of an instance during its computation."""


@dataclass(frozen=True, eq=False)
class Skin:
    """The joints to which a mesh is bound."""

    joints: list[int]
    """Nodes of the joints."""
    inverse_binds: Matrices
    """float64 array of shape (J, 4, 4). Transforms from the bind pose to each joint."""


@dataclass(frozen=True, eq=False)
class ShownMesh:
    """A mesh at a node."""

    node: int
    mesh: JsonObject
    skin: Skin | None
    """Joints that move the mesh instead of the node."""
    instances: Matrices | None
    """float64 array of shape (I, 4, 4). Transforms of instances, relative to the node; None for a
    single mesh.
    """

    @property
    def carriers(self) -> list[int]:
        """The nodes that move the mesh."""
        return [self.node] if self.skin is None else self.skin.joints


def shown_meshes(document: Document, nodes: Nodes, notes: Notes) -> list[ShownMesh]:
    """Return the triangle meshes of the default scene, or of all nodes without a scene.

    A scene may list nodes that are not roots, although glTF forbids it: each of these is included
    once, with the transforms of all its ancestors, even those outside of the scene.

    Parameters
    ----------
    notes : Notes
        Gains a sentence if the scene lists nodes that are not roots.
    """
    scene = _default_scene(document)
    roots = nodes.ordered if scene is None else scene.indices("nodes", "nodes")
    roots = list(dict.fromkeys(roots))
    inner = [node for node in roots if nodes.parents[node] >= 0]
    if scene is not None and inner:
        notes.changed(
            f"{scene.place} lists nodes that are not roots: {nodes.labels(inner)}; each is read "
            "once, with the transforms of all its ancestors"
        )
    covered = nodes.below(roots)
    read = cache(lambda number: _read_skin(document.lists["skins"][number], document))
    meshes = []
    for node in nodes.subtrees(root for root in roots if root not in covered):
        json = nodes.objects[node]
        mesh, skin = json.index("mesh", "meshes"), json.index("skin", "skins")
        if mesh is not None and triangle_primitives(document.lists["meshes"][mesh]):
            shape = document.lists["meshes"][mesh]
            is_bound = skin is not None and has_joints(shape)
            instances = None if is_bound else _read_instances(json, document)
            meshes.append(ShownMesh(node, shape, read(skin) if is_bound else None, instances))
    return meshes


def _read_skin(skin: JsonObject, document: Document) -> Skin:
    joints = skin.indices("joints", "nodes")
    if not joints:
        raise skin.error("joints", "a list of at least one node")
    if "inverseBindMatrices" not in skin:
        return Skin(joints, np.tile(np.eye(4), (len(joints), 1, 1)))
    columns = document.read_floats(skin, "inverseBindMatrices", "MAT4")
    if len(columns) < len(joints):
        raise FormatError(
            f"{skin.place}: has {len(columns)} inverse bind matrices for {len(joints)} joints; "
            "expected one per joint"
        )
    return Skin(joints, columns[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1))


def _read_instances(node: JsonObject, document: Document) -> Matrices | None:
    """Return the transforms of the instances at a node, of shape (I, 4, 4), or None without any.

    Raises
    ------
    FormatError
        If attributes differ in length, a number is not finite, or there are too many instances for
        the memory.
    """
    extension = node.extension(INSTANCING)
    attributes = None if extension is None else extension.required_child("attributes")
    stored = [name for name in INSTANCE_DEFAULTS if attributes is not None and name in attributes]
    if attributes is None or not stored:
        return None
    count = attributes.item(stored[0], "accessors").integer("count")
    document.reserve(INSTANCE_BYTES * count, f"{node.place}, with {count} instances")
    rows = [
        document.read_floats(attributes, name, f"VEC{len(default)}", count=count)
        if name in attributes
        else np.array([default], np.float64)
        for name, default in INSTANCE_DEFAULTS.items()
    ]
    return compose(rows[0], unit(rows[1]), rows[2])


def _default_scene(document: Document) -> JsonObject | None:
    """Return the default scene of a file, or else the first; None without scenes."""
    scenes = document.lists["scenes"]
    return scenes[document.root.index("scene", "scenes") or 0] if scenes else None


def no_mesh_error(document: Document, nodes: Nodes) -> FormatError:
    """Return the error for a scene without triangle meshes, with the reason."""
    meshes = document.lists["meshes"]
    if not meshes:
        return FormatError("contains no mesh")
    readable = {number for number, mesh in enumerate(meshes) if triangle_primitives(mesh)}
    if not readable:
        return FormatError("contains no triangle mesh; points and lines are not supported")
    users = [
        node for node, json in enumerate(nodes.objects) if json.index("mesh", "meshes") in readable
    ]
    scene = _default_scene(document)
    if not users or scene is None:
        noun = "triangle mesh" if len(readable) == 1 else "triangle meshes"
        return FormatError(
            f"contains {len(readable)} {noun}, but no node uses one; export it with its meshes in "
            "a scene"
        )
    return FormatError(
        f"{scene.place}, the default scene, has no triangle mesh; nodes outside of it have: "
        f"{nodes.labels(users)}; export them in the scene, or set 'scene' to another one"
    )


def note_instances(placed: Sequence[tuple[JsonObject, Matrices | None]], notes: Notes) -> None:
    """Note the instances of nodes: their number, and attributes that are left out.

    Parameters
    ----------
    placed : sequence of JsonObject and Matrices
        Nodes with a mesh, and the instances of each, or None.
    notes : Notes
        Gains the sentences.
    """
    counts = [len(instances) for _, instances in placed if instances is not None]
    if counts:
        where = f" of {len(counts)} nodes" if len(counts) > 1 else ""
        notes.changed(f"baked {sum(counts)} instances{where}, one mesh per node")
    extensions = [node.extension(INSTANCING) for node, _ in placed]
    stored = [each.required_child("attributes") for each in extensions if each is not None]
    custom = dict.fromkeys(
        name for each in stored for name in each.values if name not in INSTANCE_DEFAULTS
    )
    if custom:
        notes.left_out(f"attributes of instances: {listed(custom)}")


def repeat_geometry(
    geometry: Geometry, instances: Matrices, document: Document, place: str
) -> Geometry:
    """Return a mesh without skin repeated once per instance, concatenated.

    Faces of mirroring instances are reversed.

    Raises
    ------
    FormatError
        If the result would fill the memory.
    """
    n_verts, n_instances = len(geometry.positions), len(instances)
    document.reserve(n_instances * _size_bytes(geometry), f"{place}, with {n_instances} instances")
    if n_verts * n_instances > np.iinfo(np.int32).max:
        raise FormatError(f"{place}: {n_instances} instances of {n_verts} vertices are too many")
    linear = instances[:, :3, :3]
    is_mirrored = np.linalg.det(linear) < 0

    def transformed(rows: npt.NDArray[Any]) -> Floats:
        vectors: Floats = rows.astype(np.float64) @ linear.transpose(0, 2, 1)
        return vectors

    positions = transformed(geometry.positions) + instances[:, np.newaxis, :3, 3]
    starts = n_verts * np.arange(n_instances, dtype=np.int32)
    faces = geometry.faces + starts[:, np.newaxis, np.newaxis]
    mirrored = is_mirrored[:, np.newaxis, np.newaxis]
    return replace(
        geometry,
        positions=positions.reshape(-1, 3),
        displacements=tuple(
            None if field is None else transformed(field).reshape(-1, 3)
            for field in geometry.displacements
        ),
        faces=np.where(mirrored, reversed_triangles(faces), faces).reshape(-1, 3),
        surface=_repeat_surface(geometry.surface, is_mirrored, n_verts),
    )


def _size_bytes(geometry: Geometry) -> int:
    """Return the memory that an instance of a mesh needs, in bytes."""
    n_arrays = 1 + sum(field is not None for field in geometry.displacements)
    n_rows = sum(len(_value_rows(attribute)) for attribute in geometry.surface.attributes)
    n_rows += len(geometry.surface.groups) * len(geometry.faces)
    return 24 * n_arrays * len(geometry.positions) + 2 * geometry.faces.nbytes + 4 * n_rows


def _value_rows(attribute: Attribute) -> npt.NDArray[np.int32]:
    """Return the value row of each vertex or corner."""
    indices = attribute.indices
    return np.arange(len(attribute.values), dtype=np.int32) if indices is None else indices


def _repeat_surface(surface: Surface, is_mirrored: npt.NDArray[np.bool_], n_verts: int) -> Surface:
    n_instances = len(is_mirrored)

    def repeat(attribute: Attribute) -> Attribute:
        rows = np.tile(_value_rows(attribute), (n_instances, 1))
        if attribute.domain is Domain.CORNER:
            corners = rows[is_mirrored].reshape(int(is_mirrored.sum()), -1, 3)
            rows[is_mirrored] = reversed_triangles(corners).reshape(len(corners), -1)
        return replace(attribute, indices=rows.ravel())

    return replace(
        surface,
        attributes=tuple(map(repeat, surface.attributes)),
        groups=tuple(
            replace(groups, numbers=np.tile(groups.numbers, n_instances))
            for groups in surface.groups
        ),
        hard_edges=merged_edges([surface.hard_edges] * n_instances, [n_verts] * n_instances),
    )
