"""The vertices of a mesh as glTF has them: one for each material and set of values at a vertex."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.formats.scenes.parts import PartMesh
from meshreel.model.geometry.fans import fan_corners
from meshreel.model.surface import Attribute, Domain, Kind, Surface

Rows = npt.NDArray[Any]

MATERIAL = "material"
"""Name of the groups of faces that are written."""

MAX_WIDTH = 4
"""Most numbers that an attribute has in a glTF file."""


@dataclass(frozen=True, eq=False)
class Primitive:
    """Triangles of one material.

    Attributes
    ----------
    material : str, optional
        None for faces without one.
    verts : slice
        Its vertices among those of the mesh; no other primitive has them.
    triangles : int64 array of shape (M, 3)
        In its own vertices.
    """

    material: str | None
    verts: slice
    triangles: Integers


@dataclass(frozen=True, eq=False)
class SplitVertices:
    """A mesh whose vertices are split where values or materials meet.

    Attributes
    ----------
    sources : int64 array of shape (N,)
        The vertex that each one was.
    rows : int64 array of shape (N,)
        The row of its normal, as `NormalRows` has them; its vertex if no edge is hard.
    attributes : dict of str to array of shape (N, C)
        By what glTF calls them.
    """

    sources: Integers
    rows: Integers
    attributes: dict[str, Rows]
    primitives: tuple[Primitive, ...]

    def renumbered(self, numbers: Integers, of_rows: Integers) -> "SplitVertices":
        """The same with another number for each vertex, and each row, that there was."""
        return replace(self, sources=numbers[self.sources], rows=of_rows[self.rows])


def split_at_seams(
    part: PartMesh, rows_of_corners: npt.NDArray[np.integer] | None = None
) -> SplitVertices:
    """The vertices that faces use, in their order within each material.

    Parameters
    ----------
    rows_of_corners : integer array of shape (C,), optional
        The row of the normal of each corner, where vertices have several. Default: the vertex.
    """
    corner_of = fan_corners(part.counts).ravel()
    items = {
        Domain.VERTEX: part.corners[corner_of].astype(np.int64),
        Domain.FACE: np.repeat(np.arange(len(part.counts)), part.counts)[corner_of],
        Domain.CORNER: corner_of.astype(np.int64),
    }
    labels, materials = _materials(part.surface, len(part.counts))
    given = dict(_named_attributes(part.surface))
    rows = {name: _distinct_rows(values, items[domain]) for name, (values, domain) in given.items()}
    normal_rows = items[Domain.VERTEX]
    if rows_of_corners is not None:
        normal_rows = np.asarray(rows_of_corners, np.int64)[corner_of]
    keys = [materials[items[Domain.FACE]], items[Domain.VERTEX], normal_rows]
    splitting = [rows[name] for name in given if given[name][1] is not Domain.VERTEX]
    first, new = _unique(keys + splitting)
    attributes = {
        name: np.ascontiguousarray(values[items[domain][first]])
        for name, (values, domain) in given.items()
    }
    primitives = tuple(_primitives(keys[0][first], new.reshape(-1, 3), labels))
    return SplitVertices(items[Domain.VERTEX][first], normal_rows[first], attributes, primitives)


def describe_left_out(surface: Surface) -> Iterator[str]:
    """One sentence for each thing that a glTF file cannot hold."""
    for attribute in surface.of_kind(Kind.COLOR):
        values, most = attribute.values, 1 if attribute.values.dtype.kind == "f" else 255
        if values.size and (values.min() < 0 or values.max() > most):
            yield f"clipped colours {attribute.name!r} to 0..{most}"
    for attribute in surface.attributes:
        if _written(attribute) is None:
            width, dtype = attribute.values.shape[1], attribute.values.dtype
            yield f"left out attribute {attribute.name!r}: glTF has no {width} numbers of {dtype}"
    for groups in surface.groups:
        if groups.name != MATERIAL:
            yield f"left out the groups {groups.name!r} of faces: glTF has materials only"


def _named_attributes(surface: Surface) -> Iterator[tuple[str, tuple[Rows, Domain]]]:
    """The names of attributes in glTF, their values in its terms, and what they are values of."""
    numbers = {Kind.UV: 0, Kind.COLOR: 0}
    for attribute in surface.attributes:
        if (values := _written(attribute)) is None:
            continue
        if attribute.kind is Kind.OTHER:
            name = f"_{attribute.name.removeprefix('_')}"
        else:
            stem = "TEXCOORD" if attribute.kind is Kind.UV else "COLOR"
            name = f"{stem}_{numbers[attribute.kind]}"
            numbers[attribute.kind] += 1
        yield name, (values, attribute.domain)


def texcoord_numbers(surface: Surface) -> dict[str, int]:
    """The number of the TEXCOORD that texture coordinates of a name are written as."""
    numbers: dict[str, int] = {}
    for number, attribute in enumerate(surface.of_kind(Kind.UV)):
        numbers.setdefault(attribute.name, number)
    return numbers


def _written(attribute: Attribute) -> Rows | None:
    """Values of each item as a glTF file holds them; None if it cannot."""
    values = attribute.per_item()
    if attribute.kind is Kind.UV:
        u, v = values[:, 0].astype(np.float64), values[:, 1].astype(np.float64)
        return np.stack([u, 1 - v], axis=1).astype(np.float32)
    if attribute.kind is Kind.COLOR:
        is_float = values.dtype.kind == "f"
        clipped = values.clip(0, 1 if is_float else 255)
        return clipped.astype(np.float32 if is_float else np.uint8)
    is_held = values.dtype in (np.uint8, np.float32) and values.shape[1] <= MAX_WIDTH
    return values if is_held else None


def _materials(surface: Surface, n_faces: int) -> tuple[tuple[str | None, ...], Integers]:
    """Labels, and the number of that of each face; the last is that of faces without one."""
    for groups in surface.groups:
        if groups.name == MATERIAL:
            numbers = groups.numbers.astype(np.int64)
            return (*groups.labels, None), np.where(numbers < 0, len(groups.labels), numbers)
    return (None,), np.zeros(n_faces, np.int64)


def _distinct_rows(values: Rows, items: Integers) -> Integers:
    """A number for the value at each corner of a triangle, the same where the bits are."""
    bits = np.ascontiguousarray(values + 0).view(f"u{values.itemsize}")  # + 0: there are two zeros
    columns = [np.unique(column, return_inverse=True)[1].astype(np.int64) for column in bits.T]
    return _unique(columns)[1][items]


def _unique(keys: list[Integers]) -> tuple[Integers, Integers]:
    """Where each distinct combination of keys is first, in their order, and which each one is."""
    number = np.zeros(len(keys[0]), np.int64)
    for key in keys:
        joined = number * (int(key.max()) + 1) + key
        _, first, number = np.unique(joined, return_index=True, return_inverse=True)
    return first, number


def _primitives(
    materials: Integers, triangles: Integers, labels: tuple[str | None, ...]
) -> Iterator[Primitive]:
    """The triangles of each material, whose vertices follow one another."""
    of_triangle = materials[triangles[:, 0]]
    for number in np.unique(materials):
        low, high = np.searchsorted(materials, [number, number + 1])
        own = triangles[of_triangle == number] - low
        yield Primitive(labels[number], slice(int(low), int(high)), own)
