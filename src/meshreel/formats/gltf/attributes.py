"""Reading vertex attributes of a glTF mesh: UVs, colors and application-specific attributes."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.accessors import Values
from meshreel.formats.gltf.primitives import Block
from meshreel.formats.surfaces.welding import SplitMesh
from meshreel.model.surface import Attribute, Kind

Rows = npt.NDArray[Any]
NUMBERED = re.compile(r"(TEXCOORD|COLOR)_(\d{1,3})")
KINDS = {"TEXCOORD": Kind.UV, "COLOR": Kind.COLOR}


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
