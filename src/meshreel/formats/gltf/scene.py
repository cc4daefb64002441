"""The scene of a glTF file: the meshes at its nodes, and their skins."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.gltf.animation import Nodes
from meshreel.formats.gltf.document import Document, JsonObject
from meshreel.formats.gltf.geometry import Matrices, has_joints, triangle_primitives


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
            meshes.append(ShownMesh(node, shape, read(skin) if is_bound else None))
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
