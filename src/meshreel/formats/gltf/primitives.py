"""Primitives of a glTF mesh: triangles, UVs, colors and other vertex attributes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.gltf.accessors import Accessors, Values
from meshreel.formats.gltf.document import JsonObject
from meshreel.formats.surfaces.welding import SplitMesh
from meshreel.model.surface import Attribute, Kind

TRIANGLES, STRIP, FAN = 4, 5, 6
N_MODES = 7
ACCESSOR_TYPES = {
    "POSITION": ("VEC3",),
    "NORMAL": ("VEC3",),
    "JOINTS": ("VEC4",),
    "WEIGHTS": ("VEC4",),
    "TEXCOORD": ("VEC2",),
    "COLOR": ("VEC3", "VEC4"),
}
"""Accessor types of each supported attribute semantic, without set index."""
CUSTOM_TYPES = ("SCALAR", "VEC2", "VEC3", "VEC4")
"""Accessor types of application-specific attributes, whose names start with an underscore."""

Rows = npt.NDArray[Any]
NUMBERED = re.compile(r"(TEXCOORD|COLOR)_(\d{1,3})")
KINDS = {"TEXCOORD": Kind.UV, "COLOR": Kind.COLOR}


@dataclass(frozen=True, eq=False)
class Block:
    """Vertices shared by primitives, split at seams as in the file.

    Attributes
    ----------
    values : dict of Values
        By attribute name, including "POSITION", all with the same number of rows.
    displacements : tuple of float arrays of shape (N, 3)
        Displacements by each morph target; None for a target without positions.
    """

    values: dict[str, Values]
    displacements: tuple[npt.NDArray[Any] | None, ...]

    @property
    def n_verts(self) -> int:
        """Number of vertices."""
        return len(self.values["POSITION"].array)


def is_triangle_primitive(primitive: JsonObject) -> bool:
    """Return whether a primitive consists of triangles and has positions."""
    mode = primitive.index("mode", N_MODES)
    has_positions = "POSITION" in primitive.required_child("attributes")
    return has_positions and (mode is None or mode >= TRIANGLES)


def block_key(primitive: JsonObject) -> str:
    """Return a key that is equal for primitives with the same vertices."""
    return repr([primitive.values.get(key) for key in ("attributes", "targets", "extensions")])


def read_block(primitive: JsonObject, accessors: Accessors, decoded: dict[str, Values]) -> Block:
    """Return the vertices of a primitive.

    Parameters
    ----------
    primitive : JsonObject
    accessors : Accessors
    decoded : dict of Values
        Arrays decoded from Draco, which replace accessors.

    Raises
    ------
    FormatError
        If attributes differ in length, or have an invalid type.
    """
    attributes = primitive.required_child("attributes")
    n_verts = accessors.count(attributes, "POSITION")
    values = {
        name: decoded[name]
        if name in decoded
        else accessors.read(attributes, name, *types, count=n_verts)
        for name in attributes.values
        if (types := _accessor_types(name))
    }
    displacements = tuple(
        accessors.read(target, "POSITION", "VEC3", count=n_verts).floats()
        if "POSITION" in target
        else None
        for target in primitive.children("targets", "target")
    )
    return Block(values, displacements)


def read_triangles(
    primitive: JsonObject, accessors: Accessors, decoded: dict[str, Values], n_verts: int
) -> npt.NDArray[np.int64]:
    """Return the triangles of a primitive as indices into its block, of shape (M, 3).

    Raises
    ------
    FormatError
        If an index is out of range.
    """
    if "indices" in decoded:
        corners = decoded["indices"].array[:, 0]
    elif "indices" in primitive:
        corners = accessors.read(primitive, "indices", "SCALAR").array[:, 0]
    else:
        corners = np.arange(n_verts)
    if corners.dtype.kind not in "iu":
        raise FormatError(f"{primitive.place}: its indices are not integers")
    corners = corners.astype(np.int64)
    if len(corners) and not 0 <= corners.min() <= corners.max() < n_verts:
        raise FormatError(
            f"{primitive.place}: has vertex indices {corners.min()}..{corners.max()}; "
            f"expected 0..{n_verts - 1}"
        )
    mode = TRIANGLES if "indices" in decoded else primitive.integer("mode", TRIANGLES)
    return assemble_triangles(corners, mode)


def assemble_triangles(corners: npt.NDArray[np.int64], mode: int) -> npt.NDArray[np.int64]:
    """Return the triangles of a list, strip or fan of corners, of shape (M, 3).

    Corners after the last complete triangle of a list are ignored, as in rendering.
    """
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    number = np.arange(max(0, len(corners) - 2))
    if mode == FAN:
        return corners[np.stack([number + 1, number + 2, 0 * number], axis=1)]
    # Every other triangle of a strip is reversed, for a consistent orientation.
    odd = number % 2
    return corners[np.stack([number, number + 1 + odd, number + 2 - odd], axis=1)]


def triangle_primitives(mesh: JsonObject) -> list[JsonObject]:
    """Return the triangle primitives of a mesh."""
    return [one for one in mesh.children("primitives", "primitive") if is_triangle_primitive(one)]


def has_joints(mesh: JsonObject) -> bool:
    """Return whether a mesh can be skinned."""
    return any(
        {"JOINTS_0", "WEIGHTS_0"} <= one.required_child("attributes").values.keys()
        for one in triangle_primitives(mesh)
    )


def count_targets(mesh: JsonObject) -> int:
    """Return the number of morph targets of a mesh, the same for all of its primitives.

    Raises
    ------
    FormatError
        If primitives differ in it.
    """
    counts = {len(one.children("targets", "target")) for one in triangle_primitives(mesh)}
    if len(counts) > 1:
        raise FormatError(
            f"{mesh.place}: its primitives have {' or '.join(map(str, sorted(counts)))} morph "
            "targets; expected the same number in all"
        )
    return counts.pop() if counts else 0


def is_supported_attribute(name: str) -> bool:
    """Return whether a vertex attribute is read, or can be computed."""
    return bool(_accessor_types(name)) or name == "TANGENT"


def _accessor_types(name: str) -> tuple[str, ...]:
    """Return the valid accessor types of an attribute; empty if it is not supported."""
    if name.startswith("_"):
        return CUSTOM_TYPES
    match = re.fullmatch(r"([A-Z]+)(?:_\d+)?", name)
    return ACCESSOR_TYPES.get(match[1], ()) if match else ()


def read_attributes(
    blocks: Sequence[Block], mesh: SplitMesh, place: str, notes: list[str]
) -> tuple[Attribute, ...]:
    """Return the attributes of concatenated blocks; notes list omitted and filled ones.

    UVs come first, then colors, each by set index, then application-specific attributes, whose
    names begin with an underscore.
    """
    attributes = []
    for name in sorted({name for block in blocks for name in block.values}, key=_rank):
        if (described := meaning(name)) is None:
            continue
        label, kind = described
        rows, note = _JOINS[kind]([block.values.get(name) for block in blocks], blocks)
        if note:
            notes.append(f"{place}: {name} {note}")
        if rows is not None:
            attributes.append(mesh.attribute(label, kind, rows))
    return tuple(attributes)


def _rank(name: str) -> tuple[int, int, str]:
    match = NUMBERED.fullmatch(name)
    return (list(KINDS).index(match[1]), int(match[2]), name) if match else (len(KINDS), 0, name)


def meaning(name: str) -> tuple[str, Kind] | None:
    """Return the name and kind of an attribute in meshreel, or None if it is not supported."""
    if match := NUMBERED.fullmatch(name):
        kind = KINDS[match[1]]
        return kind.value + ("" if int(match[2]) == 0 else match[2]), kind
    return (name, Kind.OTHER) if name.startswith("_") else None


Joined = tuple[Rows | None, str]
"""Concatenated values of all blocks, and a note on them."""


def _join_uvs(stored: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    filled = [
        np.zeros((block.n_verts, 2)) if one is None else one.floats()
        for one, block in zip(stored, blocks, strict=True)
    ]
    # In glTF, v points down. Adding zero turns -0.0 into 0.0, for bitwise comparisons.
    flipped = [np.stack([uv[:, 0] + 0.0, 1 - uv[:, 1]], axis=1) for uv in filled]
    note = "is 0 1 on primitives without it" if None in stored else ""
    return np.concatenate(flipped).astype(np.float32), note


def _join_colors(stored: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    arrays = [one.array for one in stored if one is not None]
    width = max(array.shape[1] for array in arrays)
    are_bytes = all(array.dtype == np.uint8 for array in arrays)
    rows = [
        np.full((block.n_verts, width), 255 if are_bytes else 1, np.uint8 if are_bytes else "f4")
        for block in blocks
    ]
    for one, filled in zip(stored, rows, strict=True):
        if one is not None:
            colors = (
                one.array if are_bytes else Values(one.array, is_normalized=True).floats() + 0.0
            )
            filled[:, : colors.shape[1]] = colors
    return np.concatenate(rows), "is white on primitives without it" if None in stored else ""


def _join_custom(stored: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    present = [one for one in stored if one is not None]
    types = {(one.array.dtype, one.array.shape[1], one.is_normalized) for one in present}
    if len(types) > 1 or len(present) < len(blocks):
        return None, "is left out, since not all primitives have it with the same type"
    rows = np.concatenate([one.floats() if one.is_normalized else one.array for one in present])
    if rows.dtype == np.uint8:
        return rows, ""
    if rows.dtype.kind == "f":
        return rows.astype(np.float32) + np.float32(0), ""
    return rows.astype(np.float64 if rows.dtype == np.uint32 else np.int32), ""


_JOINS = {Kind.UV: _join_uvs, Kind.COLOR: _join_colors, Kind.OTHER: _join_custom}
