"""The node hierarchy of a glTF file, with local transforms."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.gltf.document import Document, JsonObject

MAX_PATH = 4096
"""Maximum length of a node path: deep hierarchies with long names would fill the memory."""


@dataclass(frozen=True, eq=False)
class LocalTransform:
    """The local transform of a node that is not animated.

    Attributes
    ----------
    matrix : float64 array of shape (4, 4), optional
        Replaces the other three.
    translation, rotation, scale : float64 arrays
        Three numbers, a unit quaternion x y z w, and three numbers.
    """

    matrix: npt.NDArray[np.float64] | None
    translation: npt.NDArray[np.float64]
    rotation: npt.NDArray[np.float64]
    scale: npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of a file.

    Attributes
    ----------
    objects : tuple of JsonObject
    parents : list of int
        Parent of each node; -1 for a root.
    depths : list of int
        Depth of each node; 0 for a root.
    """

    objects: tuple[JsonObject, ...]
    parents: list[int]
    depths: list[int]

    def ancestors(self, node: int) -> Iterator[int]:
        """Yield a node, its parent, and so on up to the root."""
        while node >= 0:
            yield node
            node = self.parents[node]

    def with_ancestors(self, nodes: Iterable[int]) -> list[int]:
        """Return nodes and all their ancestors, parents first."""
        visited: set[int] = set()
        for node in nodes:
            for one in self.ancestors(node):
                if one in visited:
                    break
                visited.add(one)
        return sorted(visited, key=lambda one: self.depths[one])

    def transform(self, node: int) -> LocalTransform:
        """Return the local transform of a node.

        Raises
        ------
        FormatError
            If a number is not finite, or a rotation has length 0.
        """
        json = self.objects[node]
        columns = json.numbers("matrix", 16).reshape(4, 4).T if "matrix" in json else None
        rotation = json.numbers("rotation", 4, (0, 0, 0, 1))
        length = float(np.linalg.norm(rotation))
        if not 0 < length < np.inf:
            raise json.error("rotation", "a quaternion of length 1")
        return LocalTransform(
            columns,
            json.numbers("translation", 3, (0, 0, 0)),
            rotation / length,
            json.numbers("scale", 3, (1, 1, 1)),
        )

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
        for one in self.ancestors(node):
            name = self.objects[one].text("name", "") or (default_name if one == node else "")
            names.append(name or f"node_{one}")
            n_characters += len(names[-1]) + 1
            if n_characters > MAX_PATH:
                raise FormatError(
                    f"node {node}: its path is longer than {MAX_PATH} characters; "
                    "nodes are nested too deeply"
                )
        return "".join(f"/{name.replace('/', '_')}" for name in reversed(names))


def read_nodes(document: Document) -> Nodes:
    """Return the nodes of a file.

    Raises
    ------
    FormatError
        If a node has several parents, or is its own ancestor.
    """
    objects = document.lists["nodes"]
    children = [one.indices("children", len(objects)) for one in objects]
    parents = [-1] * len(objects)
    for parent, own_children in enumerate(children):
        for child in own_children:
            if parents[child] >= 0:
                raise FormatError(
                    f"node {child} is a child of nodes {parents[child]} and {parent}; "
                    "a node must have one parent"
                )
            parents[child] = parent
    return Nodes(objects, parents, _depths(parents, children))


def unique_names(names: Sequence[str]) -> list[str]:
    """Return the names, with a number appended to repeated ones."""
    used, counts = set(names), dict.fromkeys(names, 0)
    unique = []
    for name in names:
        candidate = name
        while counts[name] and (candidate := f"{name}_{counts[name]}") in used:
            counts[name] += 1
        counts[name] += 1
        used.add(candidate)
        unique.append(candidate)
    return unique


def _depths(parents: list[int], children: list[list[int]]) -> list[int]:
    """Return the depth of each node; every node must be below a root."""
    depths = [0 if parent < 0 else -1 for parent in parents]
    reached = [node for node, parent in enumerate(parents) if parent < 0]
    for node in reached:  # the list grows during iteration
        for child in children[node]:
            depths[child] = depths[node] + 1
        reached += children[node]
    if len(reached) < len(parents):
        raise FormatError(f"node {depths.index(-1)} is its own ancestor: nodes must form a tree")
    return depths
