"""Building the node hierarchy of a scene from the paths of its meshes."""

from typing import Any

from meshreel.formats.gltf.quantized import IDENTITY, Placement

Json = dict[str, Any]
Path = tuple[str, ...]

SEGMENT_START = "meshreelSegmentStart"
"""Property of the extras of a node above the meshes of a segment: time of its first frame."""


class NodeTree:
    """The nodes of a scene, with parents created on demand.

    Attributes
    ----------
    nodes : list of dict
        Entries of the JSON.
    roots : list of int
    """

    def __init__(self) -> None:
        self.nodes: list[Json] = []
        self.roots: list[int] = []
        self._numbers: dict[Path, int] = {}
        self._placements: list[Placement] = []

    def add(self, name: str, mesh: int, placement: Placement) -> int:
        """Add a node with a mesh, and return its index; add shorter paths first.

        Parameters
        ----------
        name : str
            Name, or path of nodes if it starts with a slash.
        mesh : int
        placement : Placement
            Placement of the mesh in the world, independent of its parents.
        """
        path = path_of(name)
        parent = self._parent(path)
        above = self._placements[parent] if parent is not None else IDENTITY
        node: Json = {"name": path[-1], "mesh": mesh}
        shift = (placement.offset - above.offset) / above.scale
        if shift.any():
            node["translation"] = shift.tolist()
        if placement.scale != above.scale:
            node["scale"] = [placement.scale / above.scale] * 3
        return self._append(path, node, placement, parent)

    def group(self, name: str) -> int:
        """Return the index of a root node without a mesh, added if it is missing."""
        parent = self._parent((name, ""))
        assert parent is not None
        return parent

    def _parent(self, path: Path) -> int | None:
        parent = None
        for end in range(1, len(path)):
            inherited = self._placements[parent] if parent is not None else IDENTITY
            if (number := self._numbers.get(path[:end])) is None:
                number = self._append(path[:end], {"name": path[end - 1]}, inherited, parent)
            parent = number
        return parent

    def _append(self, path: Path, node: Json, placement: Placement, parent: int | None) -> int:
        number = len(self.nodes)
        self.nodes.append(node)
        self._placements.append(placement)
        self._numbers.setdefault(path, number)
        siblings = self.roots if parent is None else self.nodes[parent].setdefault("children", [])
        siblings.append(number)
        return number


def path_of(name: str) -> Path:
    """Return the node names from the root to a mesh; a single one unless its name is a path."""
    elements = tuple(element for element in name.split("/") if element)
    return elements if name.startswith("/") and elements else (name or "mesh",)
