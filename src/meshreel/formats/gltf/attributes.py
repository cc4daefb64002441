"""Texture coordinates, colours and a program's own values of a glTF mesh, as attributes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.accessors import Values
from meshreel.formats.gltf.primitives import Block
from meshreel.formats.surfaces.welding import weld_rows
from meshreel.model.surface import Attribute, Domain, Kind

Rows = npt.NDArray[Any]
NUMBERED = re.compile(r"(TEXCOORD|COLOR)_(\d{1,3})")
KINDS = {"TEXCOORD": Kind.UV, "COLOR": Kind.COLOR}


@dataclass(frozen=True, eq=False)
class SplitMesh:
    """Vertices as the file has them, and which of them are one.

    Attributes
    ----------
    vertex_of : int64 array of shape (N,)
        The vertex that each split one is.
    first : int64 array of shape (V,)
        The first split one of each vertex.
    corners : int64 array of shape (3 M,)
        The split vertex at each corner of the triangles.
    """

    vertex_of: npt.NDArray[np.int64]
    first: npt.NDArray[np.int64]
    corners: npt.NDArray[np.int64]

    def attribute(self, name: str, kind: Kind, rows: Rows) -> Attribute:
        """Values of the split vertices, of shape (N, C), of vertices or of corners.

        Of vertices if all split ones that are the same vertex have the same.
        """
        bits = np.ascontiguousarray(rows).view(f"u{rows.itemsize}")
        if (bits[self.first[self.vertex_of]] == bits).all():
            return Attribute(name, kind, Domain.VERTEX, rows[self.first])
        row_of, distinct = weld_rows([rows])
        indices = row_of[self.corners].astype(np.int32)
        return Attribute(name, kind, Domain.CORNER, rows[distinct], indices)


def read_attributes(
    blocks: Sequence[Block], mesh: SplitMesh, place: str, notes: list[str]
) -> tuple[Attribute, ...]:
    """The attributes that blocks have, one after the other; notes tell what is left out or made up.

    Texture coordinates first, then colours, both by their numbers, then those that a program made
    up, whose names begin with a low line.
    """
    found = []
    for name in sorted({name for block in blocks for name in block.values}, key=_rank):
        if (told := meaning(name)) is None:
            continue
        label, kind = told
        rows, note = _JOINS[kind]([block.values.get(name) for block in blocks], blocks)
        if note:
            notes.append(f"{place}: {name} {note}")
        if rows is not None:
            found.append(mesh.attribute(label, kind, rows))
    return tuple(found)


def _rank(name: str) -> tuple[int, int, str]:
    match = NUMBERED.fullmatch(name)
    return (list(KINDS).index(match[1]), int(match[2]), name) if match else (len(KINDS), 0, name)


def meaning(name: str) -> tuple[str, Kind] | None:
    """The name of an attribute here, and its kind; None if it is no attribute of a surface."""
    if match := NUMBERED.fullmatch(name):
        kind = KINDS[match[1]]
        return kind.value + ("" if int(match[2]) == 0 else match[2]), kind
    return (name, Kind.OTHER) if name.startswith("_") else None


Joined = tuple[Rows | None, str]
"""Values of all blocks, one after the other, and what to say of them."""


def _coordinates(given: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    filled = [
        np.zeros((block.n_verts, 2)) if one is None else one.floats()
        for one, block in zip(given, blocks, strict=True)
    ]
    # Downwards in the file; zeros are added for those that are negative to have the same bits.
    turned = [np.stack([uv[:, 0] + 0.0, 1 - uv[:, 1]], axis=1) for uv in filled]
    note = "is 0 1 where a primitive has none" if None in given else ""
    return np.concatenate(turned).astype(np.float32), note


def _colors(given: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    there = [one.array for one in given if one is not None]
    width = max(array.shape[1] for array in there)
    are_bytes = all(array.dtype == np.uint8 for array in there)
    rows = [
        np.full((block.n_verts, width), 255 if are_bytes else 1, np.uint8 if are_bytes else "f4")
        for block in blocks
    ]
    for one, filled in zip(given, rows, strict=True):
        if one is not None:
            found = one.array if are_bytes else Values(one.array, is_normalized=True).floats() + 0.0
            filled[:, : found.shape[1]] = found
    return np.concatenate(rows), "is white where a primitive has none" if None in given else ""


def _own(given: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    there = [one for one in given if one is not None]
    types = {(one.array.dtype, one.array.shape[1], one.is_normalized) for one in there}
    if len(types) > 1 or len(there) < len(blocks):
        return None, "is left out, for its primitives do not all have it alike"
    rows = np.concatenate([one.floats() if one.is_normalized else one.array for one in there])
    if rows.dtype == np.uint8:
        return rows, ""
    if rows.dtype.kind == "f":
        return rows.astype(np.float32) + np.float32(0), ""
    return rows.astype(np.float64 if rows.dtype == np.uint32 else np.int32), ""


_JOINS = {Kind.UV: _coordinates, Kind.COLOR: _colors, Kind.OTHER: _own}
