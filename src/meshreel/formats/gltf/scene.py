"""The scene of a glTF file: its nodes, and the meshes at them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

from meshreel.errors import FormatError
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.animation import Matrices
from meshreel.formats.gltf.document import Document
from meshreel.formats.gltf.geometry import Geometry
from meshreel.formats.gltf.instancing import read_instances, repeat_geometry
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.nodes import Nodes
from meshreel.formats.gltf.primitives import has_joints, triangle_primitives
from meshreel.formats.gltf.skinning import Skin, read_skin
from meshreel.formats.notes import listed


def scene_nodes(document: Document, nodes: Nodes, notes: list[str]) -> list[int]:
    """Return the nodes of the default scene, parents first; all nodes without a scene.

    A scene may list nodes that are not roots, although glTF forbids it: each of these is included
    once, with the transforms of all its ancestors, even those outside of the scene.

    Parameters
    ----------
    document : Document
    nodes : Nodes
    notes : list of str
        Gains a sentence if the scene lists nodes that are not roots.
    """
    scene = _scene(document)
    if scene is None:
        return _subtrees([node for node, parent in enumerate(nodes.parents) if parent < 0], nodes)
    listed_nodes = list(dict.fromkeys(scene.indices("nodes", len(nodes.parents))))
    if inner := [node for node in listed_nodes if nodes.parents[node] >= 0]:
        notes.append(
            f"{scene.place} lists nodes that are not roots: {_names(inner, nodes)}; each is read "
            "once, with the transforms of all its ancestors"
        )
    covered = _is_below(set(listed_nodes), nodes)
    return _subtrees([node for node in listed_nodes if not covered[node]], nodes)


def no_mesh_error(document: Document, nodes: Nodes) -> FormatError:
    """Return the error for a scene without triangle meshes, with the reason."""
    meshes = document.lists["meshes"]
    if not meshes:
        return FormatError("contains no mesh")
    readable = {number for number, mesh in enumerate(meshes) if triangle_primitives(mesh)}
    if not readable:
        return FormatError("contains no triangle mesh; points and lines are not supported")
    users = [
        node
        for node, json in enumerate(nodes.objects)
        if document.index(json, "mesh", "meshes") in readable
    ]
    scene = _scene(document)
    if not users or scene is None:
        return FormatError(
            f"contains {_counted(len(readable), 'triangle mesh', 'triangle meshes')}, but no node "
            "uses one; "
            "export it with its meshes in a scene"
        )
    return FormatError(
        f"{scene.place}, the default scene, has no triangle mesh; nodes outside of it have: "
        f"{_names(users, nodes)}; export them in the scene, or set 'scene' to another one"
    )


def _names(chosen: Iterable[int], nodes: Nodes) -> str:
    objects = [nodes.objects[node] for node in chosen]
    return listed(one.text("name", "") or one.place for one in objects)


def _counted(number: int, one: str, several: str) -> str:
    return f"{number} {one if number == 1 else several}"


def _scene(document: Document) -> JsonObject | None:
    """Return the default scene of a file, or else the first; None without scenes."""
    scenes = document.lists["scenes"]
    return scenes[document.index(document.root, "scene", "scenes") or 0] if scenes else None


def _is_below(ancestors: set[int], nodes: Nodes) -> list[bool]:
    """Return for each node whether it is below one of these."""
    covered = [False] * len(nodes.parents)
    for node in sorted(range(len(covered)), key=nodes.depths.__getitem__):
        parent = nodes.parents[node]
        covered[node] = parent >= 0 and (parent in ancestors or covered[parent])
    return covered


def _subtrees(roots: Iterable[int], nodes: Nodes) -> list[int]:
    """Return roots and all nodes below them, in depth-first order."""
    stack = list(roots)[::-1]
    subtrees = []
    while stack:
        node = stack.pop()
        subtrees.append(node)
        stack += nodes.objects[node].indices("children", len(nodes.parents))[::-1]
    return subtrees


@dataclass(frozen=True, eq=False)
class ShownMesh:
    """A mesh at a node.

    Attributes
    ----------
    node, mesh : int
    skin : Skin, optional
        Joints that move the mesh instead of the node.
    instances : float64 array of shape (I, 4, 4), optional
        Transforms of instances, relative to the node; None for a single mesh.
    """

    node: int
    mesh: int
    skin: Skin | None
    instances: Matrices | None


def shown_meshes(document: Document, nodes: Sequence[int], accessors: Accessors) -> list[ShownMesh]:
    """Return the triangle meshes at some nodes, in their order."""
    read = cache(lambda number: read_skin(document.lists["skins"][number], accessors))
    meshes = []
    for node in nodes:
        json = document.lists["nodes"][node]
        mesh = document.index(json, "mesh", "meshes")
        skin = document.index(json, "skin", "skins")
        if mesh is not None and triangle_primitives(document.lists["meshes"][mesh]):
            is_bound = skin is not None and has_joints(document.lists["meshes"][mesh])
            instances = None if is_bound else read_instances(json, accessors)
            meshes.append(ShownMesh(node, mesh, read(skin) if is_bound else None, instances))
    return meshes


def instanced_geometry(shown: ShownMesh, mesh: Geometry, accessors: Accessors) -> Geometry:
    """Return the mesh at a node at rest, with all its instances."""
    if shown.instances is None:
        return mesh
    place = accessors.document.lists["nodes"][shown.node].place
    return repeat_geometry(mesh, shown.instances, accessors, place)
