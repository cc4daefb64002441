"""Nodes of a glTF file: their hierarchy and transforms, the scene, and the meshes at its nodes."""

from collections.abc import Iterable

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.gltf.document import VISIBILITY, Document, JsonObject
from meshreel.formats.gltf.geometry import Matrices
from meshreel.formats.notes import listed

MAX_PATH = 4096
"""Maximum length of a node path: deep hierarchies with long names would fill the memory."""


class Nodes:
    """The nodes of a file.

    Parameters
    ----------
    document : Document

    Attributes
    ----------
    objects : tuple of JsonObject
    parents : list of int
        Parent of each node; -1 for a root.
    ordered : list of int
        All nodes, parents first.

    Raises
    ------
    FormatError
        If a node has several parents, or is its own ancestor.
    """

    def __init__(self, document: Document) -> None:
        self.objects: tuple[JsonObject, ...] = document.lists["nodes"]
        self.parents: list[int] = [-1] * len(self.objects)
        self._children = [node.indices("children", "nodes") for node in self.objects]
        for parent, children in enumerate(self._children):
            for child in children:
                if self.parents[child] >= 0:
                    raise FormatError(
                        f"node {child} is a child of nodes {self.parents[child]} and {parent}; "
                        "a node must have one parent"
                    )
                self.parents[child] = parent
        self.ordered: list[int] = [node for node, parent in enumerate(self.parents) if parent < 0]
        for node in self.ordered:  # the list grows during iteration
            self.ordered += self._children[node]
        if len(self.ordered) < len(self.objects):
            lost = min(set(range(len(self.objects))) - set(self.ordered))
            raise FormatError(f"node {lost} is its own ancestor: nodes must form a tree")

    def ancestors(self, node: int) -> list[int]:
        """Return a node, its parent, and so on up to the root."""
        ancestors = []
        while node >= 0:
            ancestors.append(node)
            node = self.parents[node]
        return ancestors

    def with_ancestors(self, nodes: Iterable[int]) -> list[int]:
        """Return nodes and all their ancestors, parents first."""
        visited: set[int] = set()
        for start in nodes:
            node = start
            while node >= 0 and node not in visited:
                visited.add(node)
                node = self.parents[node]
        return [node for node in self.ordered if node in visited]

    def below(self, nodes: Iterable[int]) -> set[int]:
        """Return all nodes below some nodes, without these unless they are below others."""
        above, below = set(nodes), set[int]()
        for node in self.ordered:
            if self.parents[node] in above or self.parents[node] in below:
                below.add(node)
        return below

    def with_below(self, nodes: set[int]) -> set[int]:
        """Return nodes and all nodes below them."""
        return nodes | self.below(nodes)

    def subtrees(self, roots: Iterable[int]) -> list[int]:
        """Return roots and all nodes below them, in depth-first order."""
        stack = list(roots)[::-1]
        subtrees = []
        while stack:
            node = stack.pop()
            subtrees.append(node)
            stack += self._children[node][::-1]
        return subtrees

    def path(self, node: int, default_name: str) -> str:
        """Return the path of a node: names from the root, each after a slash.

        Parameters
        ----------
        node : int
        default_name : str
            Name of the node if it has none.

        Raises
        ------
        FormatError
            If the path is longer than `MAX_PATH`.
        """
        names: list[str] = []
        n_characters = 0
        for ancestor in self.ancestors(node):
            name = self.objects[ancestor].text("name", "")
            names.append(name or (default_name if ancestor == node else "") or f"node_{ancestor}")
            n_characters += len(names[-1]) + 1
            if n_characters > MAX_PATH:
                raise FormatError(
                    f"node {node}: its path is longer than {MAX_PATH} characters; "
                    "nodes are nested too deeply"
                )
        return "".join(f"/{name.replace('/', '_')}" for name in reversed(names))

    def labels(self, nodes: Iterable[int]) -> str:
        """Return the names of some nodes for messages."""
        return listed(self.objects[node].label() for node in nodes)

    def hidden(self) -> list[int]:
        """Return the nodes that are hidden themselves without an animation."""
        extensions = [node.extension(VISIBILITY) for node in self.objects]
        return [
            node
            for node, extension in enumerate(extensions)
            if extension is not None and extension.values.get("visible") is False
        ]

    def rest(self, nodes: Iterable[int]) -> dict[int, tuple[Matrices | None, dict[str, Floats]]]:
        """Return the matrix of each node, if it has one, and its other properties.

        These are a translation, a unit quaternion x y z w, and a scale. A matrix has the shape
        (1, 4, 4).

        Raises
        ------
        FormatError
            If a number is not finite, or a rotation has length 0.
        """
        properties: dict[int, tuple[Matrices | None, dict[str, Floats]]] = {}
        for node in nodes:
            json, matrix = self.objects[node], None
            if "matrix" in json:
                matrix = json.numbers("matrix", 16).reshape(1, 4, 4).transpose(0, 2, 1)
            rest = json.vectors(translation=(0, 0, 0), rotation=(0, 0, 0, 1), scale=(1, 1, 1))
            length = float(np.linalg.norm(rest["rotation"]))
            if not 0 < length < np.inf:
                raise json.error("rotation", "a quaternion of length 1")
            rest["rotation"] /= length
            properties[node] = matrix, rest
        return properties
