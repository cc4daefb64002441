"""The nodes of a glTF file that the scene shows."""

from collections.abc import Iterable

from meshreel.errors import FormatError
from meshreel.formats.gltf.document import Document
from meshreel.formats.gltf.nodes import Nodes


def shown_nodes(document: Document, nodes: Nodes) -> list[int]:
    """The nodes of the scene that a file shows, each after its parent; all if it has no scene.

    Raises
    ------
    FormatError
        If the scene lists a node that has a parent.
    """
    scenes = document.lists["scenes"]
    if not scenes:
        return _below(range(len(nodes.parents)), nodes)
    scene = scenes[document.index(document.root, "scene", "scenes") or 0]
    roots = list(dict.fromkeys(scene.indices("nodes", len(nodes.parents))))
    for root in roots:
        if nodes.parents[root] >= 0:
            raise FormatError(
                f"{scene.place}: lists node {root}, which is a child of node {nodes.parents[root]}"
            )
    return _below(roots, nodes)


def _below(roots: Iterable[int], nodes: Nodes) -> list[int]:
    """Roots and what is below them, in the order of a walk through the tree."""
    stack = [root for root in roots if nodes.parents[root] < 0][::-1]
    found = []
    while stack:
        node = stack.pop()
        found.append(node)
        stack += nodes.objects[node].indices("children", len(nodes.parents))[::-1]
    return found
