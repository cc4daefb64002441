"""The nodes of a glTF file that the scene shows, and the meshes at them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

from meshreel.errors import FormatError
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.document import Document
from meshreel.formats.gltf.geometry import Geometry
from meshreel.formats.gltf.instancing import read_instances, repeated
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.motion import Matrices
from meshreel.formats.gltf.nodes import Nodes
from meshreel.formats.gltf.primitives import has_joints, surfaces
from meshreel.formats.gltf.skinning import Skin, read_skin
from meshreel.formats.notes import listed


def shown_nodes(document: Document, nodes: Nodes, notes: list[str]) -> list[int]:
    """The nodes of the scene that a file shows, each after its parent; all if it has no scene.

    A scene may list nodes that are below others, though it must not: each is there once all the
    same, and under all nodes above it, whether the scene shows these or not.

    Parameters
    ----------
    notes : list of str
        Gains a sentence if the scene lists nodes that are below others.
    """
    scene = _scene(document)
    if scene is None:
        return _below([node for node, parent in enumerate(nodes.parents) if parent < 0], nodes)
    given = list(dict.fromkeys(scene.indices("nodes", len(nodes.parents))))
    if inner := [node for node in given if nodes.parents[node] >= 0]:
        notes.append(
            f"{scene.place} lists nodes that are below others: {_names(inner, nodes)}; each is "
            "shown once, under the transforms of all nodes above it"
        )
    covered = _covered(set(given), nodes)
    return _below([node for node in given if not covered[node]], nodes)


def nothing_shown(document: Document, nodes: Nodes) -> FormatError:
    """The error to raise where no node that is shown has a mesh of triangles, saying why."""
    meshes = document.lists["meshes"]
    if not meshes:
        return FormatError("holds no mesh")
    whole = {number for number, mesh in enumerate(meshes) if surfaces(mesh)}
    if not whole:
        return FormatError("holds no mesh of triangles; points and lines are not read")
    users = [
        node
        for node, given in enumerate(nodes.objects)
        if document.index(given, "mesh", "meshes") in whole
    ]
    scene = _scene(document)
    if not users or scene is None:
        return FormatError(
            f"holds {_counted(len(whole), 'mesh', 'meshes')} of triangles, but no node shows one; "
            "export it with its meshes in a scene"
        )
    return FormatError(
        f"{scene.place}, which the file shows, has no mesh of triangles; nodes outside it have: "
        f"{_names(users, nodes)}; export it with them in the scene, or let 'scene' name another one"
    )


def _names(chosen: Iterable[int], nodes: Nodes) -> str:
    objects = [nodes.objects[node] for node in chosen]
    return listed(one.text("name", "") or one.place for one in objects)


def _counted(number: int, one: str, several: str) -> str:
    return f"{number} {one if number == 1 else several}"


def _scene(document: Document) -> JsonObject | None:
    """The scene that a file shows: the one it names, or the first."""
    scenes = document.lists["scenes"]
    return scenes[document.index(document.root, "scene", "scenes") or 0] if scenes else None


def _covered(given: set[int], nodes: Nodes) -> list[bool]:
    """Whether each node is below one of these."""
    covered = [False] * len(nodes.parents)
    for node in sorted(range(len(covered)), key=nodes.depths.__getitem__):
        parent = nodes.parents[node]
        covered[node] = parent >= 0 and (parent in given or covered[parent])
    return covered


def _below(roots: Iterable[int], nodes: Nodes) -> list[int]:
    """Roots and what is below them, in the order of a walk through the tree."""
    stack = list(roots)[::-1]
    found = []
    while stack:
        node = stack.pop()
        found.append(node)
        stack += nodes.objects[node].indices("children", len(nodes.parents))[::-1]
    return found


@dataclass(frozen=True, eq=False)
class Placement:
    """A mesh that a node shows.

    Attributes
    ----------
    skin : Skin, optional
        The joints that the mesh follows, in place of the node.
    instances : float64 array of shape (I, 4, 4), optional
        Where copies of the mesh are, seen from the node; None for the mesh itself.
    """

    node: int
    mesh: int
    skin: Skin | None
    instances: Matrices | None


def placements_of(
    document: Document, nodes: Sequence[int], accessors: Accessors
) -> list[Placement]:
    """The meshes of triangles that some nodes show, in their order."""
    read = cache(lambda number: read_skin(document.lists["skins"][number], accessors))
    found = []
    for node in nodes:
        given = document.lists["nodes"][node]
        mesh = document.index(given, "mesh", "meshes")
        skin = document.index(given, "skin", "skins")
        if mesh is not None and surfaces(document.lists["meshes"][mesh]):
            is_bound = skin is not None and has_joints(document.lists["meshes"][mesh])
            instances = None if is_bound else read_instances(given, accessors)
            found.append(Placement(node, mesh, read(skin) if is_bound else None, instances))
    return found


def shape_of(placement: Placement, mesh: Geometry, accessors: Accessors) -> Geometry:
    """The mesh that a node shows at rest: itself, or all copies of it."""
    if placement.instances is None:
        return mesh
    place = accessors.document.lists["nodes"][placement.node].place
    return repeated(mesh, placement.instances, accessors, place)
