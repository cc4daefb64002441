"""The meshes that nodes of a glTF file show."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.document import Document
from meshreel.formats.gltf.geometry import Geometry
from meshreel.formats.gltf.instancing import read_instances, repeated
from meshreel.formats.gltf.motion import Matrices
from meshreel.formats.gltf.primitives import has_joints, surfaces
from meshreel.formats.gltf.skinning import Skin, read_skin


@dataclass(frozen=True, eq=False)
class Placement:
    """A mesh that a node shows.

    Attributes
    ----------
    node, mesh : int
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
