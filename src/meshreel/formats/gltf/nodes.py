"""The nodes of a glTF file: a forest, each node with a transform of its own."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.gltf.document import Document
from meshreel.formats.gltf.json_object import JsonObject

MAX_PATH = 4096
"""Most characters of the path of a node: deep trees of long names would fill the memory."""


@dataclass(frozen=True, eq=False)
class LocalTransform:
    """Where a node stands in its parent while nothing moves it.

    Attributes
    ----------
    matrix : float64 array of shape (4, 4), optional
        In place of the other three.
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
    parents : list of int
        Of each node; -1 for a root.
    depths : list of int
        0 for a root.
    """

    objects: tuple[JsonObject, ...]
    parents: list[int]
    depths: list[int]

    def line(self, node: int) -> Iterator[int]:
        """A node, its parent, and so on up to a root."""
        while node >= 0:
            yield node
            node = self.parents[node]

    def family(self, nodes: Iterable[int]) -> list[int]:
        """The nodes and all those above them; each after its parent."""
        found: set[int] = set()
        for node in nodes:
            for one in self.line(node):
                if one in found:
                    break
                found.add(one)
        return sorted(found, key=lambda one: self.depths[one])

    def transform(self, node: int) -> LocalTransform:
        """The transform of a node as it stands in the file.

        Raises
        ------
        FormatError
            If a number is not finite, or a rotation is none.
        """
        given = self.objects[node]
        columns = given.numbers("matrix", 16).reshape(4, 4).T if "matrix" in given else None
        rotation = given.numbers("rotation", 4, (0, 0, 0, 1))
        length = float(np.linalg.norm(rotation))
        if not 0 < length < np.inf:
            raise given.error("rotation", "a quaternion of length 1")
        return LocalTransform(
            columns,
            given.numbers("translation", 3, (0, 0, 0)),
            rotation / length,
            given.numbers("scale", 3, (1, 1, 1)),
        )

    def path(self, node: int, nameless: str) -> str:
        """Names from the root down to a node, each after a slash.

        Parameters
        ----------
        nameless : str
            What the node is called if it has no name.

        Raises
        ------
        FormatError
            If it is unreasonably long.
        """
        names: list[str] = []
        n_characters = 0
        for one in self.line(node):
            given = self.objects[one].text("name", "") or (nameless if one == node else "")
            names.append(given or f"node_{one}")
            n_characters += len(names[-1]) + 1
            if n_characters > MAX_PATH:
                raise FormatError(
                    f"node {node}: its path is longer than {MAX_PATH} characters; "
                    "nodes are nested too deeply"
                )
        return "".join(f"/{name.replace('/', '_')}" for name in reversed(names))


def read_nodes(document: Document) -> Nodes:
    """The nodes of a file.

    Raises
    ------
    FormatError
        If a node has several parents, or is above itself.
    """
    objects = document.lists["nodes"]
    children = [one.indices("children", len(objects)) for one in objects]
    parents = [-1] * len(objects)
    for parent, of_it in enumerate(children):
        for child in of_it:
            if parents[child] >= 0:
                raise FormatError(
                    f"node {child} is a child of nodes {parents[child]} and {parent}; "
                    "a node has one parent"
                )
            parents[child] = parent
    return Nodes(objects, parents, _depths(parents, children))


def unique_names(names: Sequence[str]) -> list[str]:
    """The names, those that came before with a number behind them."""
    taken, counts = set(names), dict.fromkeys(names, 0)
    unique = []
    for name in names:
        found = name
        while counts[name] and (found := f"{name}_{counts[name]}") in taken:
            counts[name] += 1
        counts[name] += 1
        taken.add(found)
        unique.append(found)
    return unique


def _depths(parents: list[int], children: list[list[int]]) -> list[int]:
    """How deep each node is; every one must be below a root."""
    depths = [0 if parent < 0 else -1 for parent in parents]
    reached = [node for node, parent in enumerate(parents) if parent < 0]
    for node in reached:  # grows meanwhile
        for child in children[node]:
            depths[child] = depths[node] + 1
        reached += children[node]
    if len(reached) < len(parents):
        raise FormatError(f"node {depths.index(-1)} is above itself: nodes must be a tree")
    return depths
