"""Primitives of a glTF mesh: their triangles, and what each of their vertices has."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.gltf.accessors import Accessors, Values
from meshreel.formats.gltf.json_object import JsonObject

TRIANGLES, STRIP, FAN = 4, 5, 6
N_MODES = 7
KINDS = {
    "POSITION": ("VEC3",),
    "NORMAL": ("VEC3",),
    "JOINTS": ("VEC4",),
    "WEIGHTS": ("VEC4",),
    "TEXCOORD": ("VEC2",),
    "COLOR": ("VEC3", "VEC4"),
}
"""Attributes that are read, without their numbers, and the kinds that they can be of."""
OWN_KINDS = ("SCALAR", "VEC2", "VEC3", "VEC4")
"""Kinds of attributes that a program made up; their names begin with a low line."""


@dataclass(frozen=True, eq=False)
class Block:
    """Vertices that primitives have in common, as the file has them: split at seams.

    Attributes
    ----------
    values : dict of Values
        By the names of the attributes; "POSITION" is there, and all have as many rows.
    displacements : tuple of float arrays of shape (N, 3)
        Of the positions by each morph target; None where a target has none.
    """

    values: dict[str, Values]
    displacements: tuple[npt.NDArray[Any] | None, ...]

    @property
    def n_verts(self) -> int:
        """Number of vertices."""
        return len(self.values["POSITION"].array)


def is_surface(primitive: JsonObject) -> bool:
    """Whether a primitive is made of triangles, and has positions."""
    mode = primitive.index("mode", N_MODES)
    has_positions = "POSITION" in primitive.needed("attributes")
    return has_positions and (mode is None or mode >= TRIANGLES)


def block_key(primitive: JsonObject) -> str:
    """The same for primitives that have the same vertices."""
    return repr([primitive.values.get(key) for key in ("attributes", "targets", "extensions")])


def read_block(primitive: JsonObject, accessors: Accessors, packed: dict[str, Values]) -> Block:
    """The vertices of a primitive.

    Parameters
    ----------
    packed : dict of Values
        What Draco holds of it, in place of the accessors.

    Raises
    ------
    FormatError
        If attributes have different numbers of vertices, or are of a kind that they cannot be.
    """
    attributes = primitive.needed("attributes")
    n_verts = accessors.count(attributes, "POSITION")
    values = {
        name: packed[name]
        if name in packed
        else accessors.read(attributes, name, *kinds, count=n_verts)
        for name in attributes.values
        if (kinds := _kinds(name))
    }
    displacements = tuple(
        accessors.read(target, "POSITION", "VEC3", count=n_verts).floats()
        if "POSITION" in target
        else None
        for target in primitive.children("targets", "target")
    )
    return Block(values, displacements)


def read_triangles(
    primitive: JsonObject, accessors: Accessors, packed: dict[str, Values], n_verts: int
) -> npt.NDArray[np.int64]:
    """The triangles of a primitive, in the vertices of its block, of shape (M, 3).

    Raises
    ------
    FormatError
        If one names a vertex that is not there.
    """
    if "indices" in packed:
        corners = packed["indices"].array[:, 0]
    elif "indices" in primitive:
        corners = accessors.read(primitive, "indices", "SCALAR").array[:, 0]
    else:
        corners = np.arange(n_verts)
    if corners.dtype.kind not in "iu":
        raise FormatError(f"{primitive.place}: its indices are no whole numbers")
    corners = corners.astype(np.int64)
    if len(corners) and not 0 <= corners.min() <= corners.max() < n_verts:
        raise FormatError(
            f"{primitive.place}: names vertices {corners.min()}..{corners.max()}; "
            f"indices must be in 0..{n_verts - 1}"
        )
    mode = TRIANGLES if "indices" in packed else primitive.whole("mode", TRIANGLES)
    return cut_triangles(corners, mode)


def cut_triangles(corners: npt.NDArray[np.int64], mode: int) -> npt.NDArray[np.int64]:
    """The triangles that a list, a strip or a fan of corners means, of shape (M, 3).

    What is left of a list behind its last whole triangle is dropped, as it is when it is drawn.
    """
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    number = np.arange(max(0, len(corners) - 2))
    if mode == FAN:
        return corners[np.stack([number + 1, number + 2, 0 * number], axis=1)]
    # Every other triangle of a strip is turned, so that all face the same side.
    odd = number % 2
    return corners[np.stack([number, number + 1 + odd, number + 2 - odd], axis=1)]


def surfaces(mesh: JsonObject) -> list[JsonObject]:
    """The primitives of a mesh that are made of triangles."""
    return [one for one in mesh.children("primitives", "primitive") if is_surface(one)]


def has_joints(mesh: JsonObject) -> bool:
    """Whether joints can move a mesh."""
    return any(
        {"JOINTS_0", "WEIGHTS_0"} <= one.needed("attributes").values.keys()
        for one in surfaces(mesh)
    )


def count_targets(mesh: JsonObject) -> int:
    """Number of morph targets of a mesh, which is that of each of its primitives.

    Raises
    ------
    FormatError
        If primitives have different numbers.
    """
    counts = {len(one.children("targets", "target")) for one in surfaces(mesh)}
    if len(counts) > 1:
        raise FormatError(
            f"{mesh.place}: its primitives have {' or '.join(map(str, sorted(counts)))} morph "
            "targets; all must have as many"
        )
    return counts.pop() if counts else 0


def is_read(name: str) -> bool:
    """Whether an attribute of vertices is read, or follows from what is."""
    return bool(_kinds(name)) or name == "TANGENT"


def _kinds(name: str) -> tuple[str, ...]:
    """The kinds that an attribute can be of; none if it is not read."""
    if name.startswith("_"):
        return OWN_KINDS
    match = re.fullmatch(r"([A-Z]+)(?:_\d+)?", name)
    return KINDS.get(match[1], ()) if match else ()
