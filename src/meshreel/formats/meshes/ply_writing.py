"""A frame to the bytes of a PLY file, binary little endian.

Written: positions as float or double, polygons, colours and texture coordinates, and single
numbers of vertices and of faces under their own names.
"""

import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.meshes.ply import INDEX_NAMES
from meshreel.formats.meshes.ply_surface import COLOR_NAMES, CORNER_UV_NAME, PASSED_OVER, UV_NAMES
from meshreel.formats.notes import note_unwritten
from meshreel.geometry.fans import join_fans
from meshreel.geometry.ragged import ragged_indices
from meshreel.sequence import Faces, Vertices
from meshreel.surface import PLAIN, Attribute, Domain, Kind, Surface

TYPE_NAMES = {"<u1": "uchar", "<i4": "int", "<f4": "float", "<f8": "double"}
RESERVED = {*PASSED_OVER, *COLOR_NAMES, *(name for names in UV_NAMES for name in names)}
RESERVED |= {*INDEX_NAMES, CORNER_UV_NAME}

HEADER_BEGIN = ("ply", "format binary_little_endian 1.0")

Column = tuple[str, npt.NDArray[Any]]
Lists = tuple[npt.NDArray[np.int64], npt.NDArray[Any]]


def ply_encoder(
    faces: Faces, surface: Surface = PLAIN, notes: list[str] | None = None
) -> Callable[[Vertices], bytes]:
    """A function from the positions of a frame, of shape (V, 3), to the bytes of its PLY file.

    Float32 and float64 positions read back exactly. All but positions is written out once.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    surface : Surface, optional
    notes : list of str, optional
        Gains a sentence on what a PLY file does not hold of the surface.
    """
    of_verts, of_faces = _held(surface, Domain.VERTEX), _held(surface, Domain.FACE)
    of_corners = _held(surface, Domain.CORNER)
    note_unwritten(surface, (*of_verts, *of_faces, *of_corners), ".ply", notes)
    columns = [column for one in of_verts for column in _columns(one)]
    face_header, face_bytes = _face_table(faces, surface, of_faces, of_corners)

    def encode(vertices: Vertices) -> bytes:
        is_single = vertices.dtype == np.float32
        positions = vertices.astype("f4" if is_single else "f8", copy=False)
        fields = [*zip("xyz", positions.T, strict=True), *columns]
        rows = np.empty(len(vertices), [(name, _code(values)) for name, values in fields])
        for name, values in fields:
            rows[name] = values
        declared = [f"property {TYPE_NAMES[_code(values)]} {name}" for name, values in fields]
        header = [*HEADER_BEGIN, f"element vertex {len(vertices)}", *declared, *face_header, ""]
        return "\n".join(header).encode("ascii") + rows.tobytes() + face_bytes

    return encode


def _face_table(
    faces: Faces, surface: Surface, of_faces: list[Attribute], of_corners: list[Attribute]
) -> tuple[list[str], bytes]:
    """The lines of the header that declare faces, and the faces."""
    counts = surface.sizes(len(faces)).astype(np.int64)
    lists = [(INDEX_NAMES[0], counts, join_fans(counts, faces))]
    lists += [(CORNER_UV_NAME, 2 * counts, one.per_item().ravel()) for one in of_corners]
    header, fields = [f"element face {len(counts)}"], list[Lists]()
    for name, lengths, values in lists:
        count_code = "<u1" if lengths.max() < 256 else "<i4"
        code = _code(values)
        header.append(f"property list {TYPE_NAMES[count_code]} {TYPE_NAMES[code]} {name}")
        fields += [(np.ones_like(counts), lengths.astype(count_code)), (lengths, values)]
    for name, values in (column for one in of_faces for column in _columns(one)):
        header.append(f"property {TYPE_NAMES[_code(values)]} {name}")
        fields.append((np.ones_like(counts), values))
    return [*header, "end_header"], _interleaved(fields)


def _interleaved(fields: list[Lists]) -> bytes:
    """Rows that have of each field its next numbers, as many as its length of the row says."""
    widths = [lengths * values.itemsize for lengths, values in fields]
    row_widths = np.sum(widths, axis=0)
    starts = np.cumsum(row_widths) - row_widths
    table = np.empty(int(row_widths.sum()), np.uint8)
    for (_, values), width in zip(fields, widths, strict=True):
        in_order = np.ascontiguousarray(values, _code(values))
        table[ragged_indices(starts, width)] = in_order.view(np.uint8)
        starts = starts + width
    return table.tobytes()


def _held(surface: Surface, domain: Domain) -> list[Attribute]:
    """The attributes of that domain that a PLY file can hold, in the order of reading."""
    found: dict[str, Attribute] = {}
    for kind in (Kind.COLOR, Kind.UV, Kind.OTHER):
        for one in surface.of_kind(kind):
            key = one.name if kind is Kind.OTHER else kind
            if one.domain is domain and key not in found and _can_be_held(one):
                found[key] = one
    return list(found.values())


def _can_be_held(one: Attribute) -> bool:
    code, width = _code(one.values), one.values.shape[1]
    if one.kind is Kind.COLOR:
        return one.domain is not Domain.CORNER and width in (3, 4) and code != "<i4"
    if one.kind is Kind.UV:
        return one.domain is not Domain.FACE and width == 2 and code in ("<f4", "<f8")
    is_word = re.fullmatch("[!-~]+", one.name) is not None and one.name not in RESERVED
    return one.domain is not Domain.CORNER and width == 1 and is_word


def _columns(one: Attribute) -> Iterator[Column]:
    """The properties that hold an attribute of vertices or faces."""
    names = {Kind.COLOR: COLOR_NAMES, Kind.UV: UV_NAMES[0], Kind.OTHER: (one.name,)}[one.kind]
    return zip(names, one.per_item().T, strict=False)


def _code(values: npt.NDArray[Any]) -> str:
    """Numpy type code, little endian."""
    return f"<{values.dtype.kind}{values.itemsize}"
