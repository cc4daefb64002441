"""Sections of a surface, written and read."""

import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.layout import Section
from meshreel.codec.choices import Order
from meshreel.codec.memory import DEFAULT_LIMIT, MemoryLimit
from meshreel.codec.surface.codes import DOMAINS, KINDS
from meshreel.codec.surface.materials import (
    read_image,
    read_material,
    write_image,
    write_material,
)
from meshreel.codec.surface.nearness import along_faces, distinct_rows, places_of
from meshreel.codec.surface.texts import read_text, write_text
from meshreel.codec.surface.uv_grid import is_quantized, uv_integers
from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.references import decode_references, encode_references
from meshreel.entropy.tables import decode_table, encode_grid_table, encode_table
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, InvalidInputError, TruncatedStreamError
from meshreel.geometry.fans import join_fans
from meshreel.geometry.hard_edges import SharedEdges, hard_flags, shared_edges
from meshreel.surface import (
    MAX_NUMBERS,
    VALUE_TYPES,
    Attribute,
    Domain,
    FaceGroups,
    Part,
    Surface,
)

Integers = npt.NDArray[np.integer]
Faces = npt.NDArray[np.int32]

EACH, INDEXED, SHARED = range(3)
"""Layouts of values: each item has its own row; the row of each is named; or it is named only to be
written, and each item has its own again when it is read."""

ROW_BYTES = 32
"""Of a row of a table while it is decoded: what it is expected from, beside its numbers."""

START = struct.Struct("<d")

Read = TypeVar("Read")


def surface_sections(
    surface: Surface, faces: Faces, uv_bits: int | None = None
) -> Iterator[tuple[Section, bytes]]:
    """The sections of a surface of a mesh with these triangles; none if it is plain.

    Parameters
    ----------
    surface : Surface
    faces : int32 array of shape (M, 3)
        As they go out when the stream is decoded.
    uv_bits : int, optional
        Bits of the grid that texture coordinates are quantised to. Default: they are exact.

    Raises
    ------
    InvalidInputError
        If a hard edge does not lie between two faces or more.
    """
    if surface.face_sizes is not None:
        sizes = surface.face_sizes
        yield Section.POLYGONS, write_varint(len(sizes)) + encode_integers([sizes - 3])
    for attribute in surface.attributes:
        yield Section.ATTRIBUTE, _write_attribute(attribute, surface, faces, uv_bits)
    for groups in surface.groups:
        yield Section.GROUPS, _write_groups(groups)
    if surface.parts:
        yield Section.PARTS, _write_parts(surface.parts)
    if surface.hard_edges is not None:
        yield Section.HARD_EDGES, _write_hard_edges(surface, faces)
    for material in surface.materials:
        yield Section.MATERIAL, write_material(material)
    for image in surface.images:
        yield Section.IMAGE, write_image(image)


def read_surface(
    sections: Iterable[tuple[Section, bytes]],
    faces: Faces,
    n_verts: int,
    limit: MemoryLimit = DEFAULT_LIMIT,
) -> Surface:
    """The surface that `surface_sections` wrote; sections of other kinds are ignored.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If a section is damaged, or does not fit the mesh.
    MemoryLimitError
        If the table of an attribute is larger than allowed.
    """
    surface, parts = Surface(), list[Part]()
    stored = list(sections)
    for once in (Section.POLYGONS, Section.PARTS, Section.HARD_EDGES):
        if sum(section is once for section, _ in stored) > 1:
            raise CorruptStreamError(f"the stream has section {once.name} more than once")
    try:
        for section, payload in stored:
            if section is Section.POLYGONS:
                surface = replace(surface, face_sizes=_read_sizes(payload, len(faces)))
        surface = surface.validated(n_verts, len(faces))
        for section, payload in stored:
            if section is Section.ATTRIBUTE:
                attribute = _read_attribute(payload, surface, faces, n_verts, limit)
                surface = replace(surface, attributes=(*surface.attributes, attribute))
            elif section is Section.GROUPS:
                groups = _read_groups(payload, surface.n_faces(len(faces)))
                surface = replace(surface, groups=(*surface.groups, groups))
            elif section is Section.PARTS:
                parts += _read_parts(payload)
            elif section is Section.HARD_EDGES:
                surface = replace(surface, hard_edges=_read_hard_edges(payload, surface, faces))
        surface = replace(
            surface,
            parts=tuple(parts),
            materials=_all_of(Section.MATERIAL, stored, read_material),
            images=_all_of(Section.IMAGE, stored, read_image),
        )
        return surface.validated(n_verts, len(faces))
    except InvalidInputError as error:
        raise CorruptStreamError(f"the surface does not fit the mesh: {error}") from error


def _all_of(
    wanted: Section, stored: Sequence[tuple[Section, bytes]], read: Callable[[bytes], Read]
) -> tuple[Read, ...]:
    return tuple(read(payload) for section, payload in stored if section is wanted)


def surface_in_order(surface: Surface, order: Order, internal_to_given: Integers) -> Surface:
    """The part of a surface that a stream with this choice of order holds.

    Attributes of faces and corners, groups and materials need the order of faces; without it, only
    attributes of vertices and hard edges remain.

    Parameters
    ----------
    surface : Surface
    order : Order
    internal_to_given : integer array of shape (V,)
        Given number of each internal vertex.
    """
    if order is Order.KEEP:
        return surface
    kept, hard_edges = surface.attributes, surface.hard_edges
    kept = tuple(one for one in kept if one.domain is Domain.VERTEX)
    if order is Order.DROP:
        kept = tuple(_of_vertices(one, internal_to_given) for one in kept)
        if hard_edges is not None:
            hard_edges = np.argsort(internal_to_given).astype(np.int32)[hard_edges]
    return Surface(attributes=kept, hard_edges=hard_edges)


def order_loss_note(surface: Surface, order: Order) -> str:
    """A note on what a stream with this choice of order leaves out; possibly empty."""
    if order is Order.KEEP:
        return ""
    lost = ["polygons"] if surface.face_sizes is not None else []
    lost += [f"{one.kind} {one.name!r}" for one in surface.attributes
             if one.domain is not Domain.VERTEX]  # fmt: skip
    lost += [f"groups {one.name!r}" for one in surface.groups]
    lost += ["parts"] if surface.parts else []
    lost += [f"material {one.name!r}" for one in surface.materials]
    if n_images := len(surface.images):
        lost.append(f"{n_images} image{'s' if n_images > 1 else ''}")
    return f"left out, since the order of faces is not kept: {', '.join(lost)}" if lost else ""


def write_start(start_s: float) -> bytes:
    """Payload of the time of the first frame."""
    return START.pack(start_s)


def _of_vertices(given: Attribute, internal_to_given: Integers) -> Attribute:
    if given.indices is not None:
        return replace(given, indices=given.indices[internal_to_given])
    return replace(given, values=given.values[internal_to_given])


def _read_sizes(payload: bytes, n_triangles: int) -> npt.NDArray[np.int32]:
    n_faces, position = read_varint(payload, 0)
    if n_faces > n_triangles:
        raise CorruptStreamError(f"{n_faces} polygons are announced for {n_triangles} triangles")
    (above,) = decode_integers(payload[position:], [n_faces])
    if n_faces and not 0 <= above.min() <= above.max() <= n_triangles:
        raise CorruptStreamError("a polygon has fewer than 3 corners, or too many")
    return (above + 3).astype(np.int32)


def _write_attribute(
    attribute: Attribute, surface: Surface, faces: Faces, uv_bits: int | None
) -> bytes:
    kind, domain = KINDS.index(attribute.kind), DOMAINS.index(attribute.domain)
    number_type = VALUE_TYPES.index(attribute.values.dtype)
    head = bytes([kind, domain, number_type, attribute.values.shape[1]])
    return head + write_text(attribute.name) + _write_values(attribute, surface, faces, uv_bits)


def _write_values(
    attribute: Attribute, surface: Surface, faces: Faces, uv_bits: int | None
) -> bytes:
    """The shortest of the layouts that fit: how many rows, the row of each item, the rows."""
    domain, indices = attribute.domain, attribute.indices
    bits = uv_bits if is_quantized(attribute) else None
    values = attribute.values if bits is None else uv_integers(attribute, bits)
    places = places_of(domain, surface, faces, len(values if indices is None else indices))

    def written(layout: int, rows: Integers | None, table: npt.NDArray[Any]) -> bytes:
        references = b"" if rows is None else encode_references(rows, places)
        counts = write_varint(len(table)) + write_varint(len(references))
        along = along_faces(domain, rows, surface, faces)
        coded = (
            encode_table(table, along) if bits is None else encode_grid_table(table, bits, along)
        )
        return bytes([layout]) + counts + references + coded

    if indices is not None:
        return written(INDEXED, indices, values)
    found = [written(EACH, None, values)]
    if domain is Domain.CORNER:
        first, rows = distinct_rows(values, places)
        found.append(written(SHARED, rows, values[first]))
    return min(found, key=len)


def _read_attribute(
    payload: bytes, surface: Surface, faces: Faces, n_verts: int, limit: MemoryLimit
) -> Attribute:
    if len(payload) < 4:
        raise TruncatedStreamError("an attribute ends inside its first four bytes")
    kind, domain, number_type, width = payload[:4]
    if not 1 <= width <= MAX_NUMBERS:
        raise CorruptStreamError(f"values of {width} numbers; 1..{MAX_NUMBERS} are allowed")
    if kind >= len(KINDS) or domain >= len(DOMAINS) or number_type >= len(VALUE_TYPES):
        raise CorruptStreamError(
            f"an attribute is of kind {kind}, domain {domain} and number type {number_type}, "
            "one of which is unknown"
        )
    name, position = read_text(payload, 4)
    layout, n_rows, rows, packed = _read_rows(
        payload, position, DOMAINS[domain], surface, faces, n_verts
    )
    row_bytes = ROW_BYTES + width * VALUE_TYPES[number_type].itemsize
    limit.require(n_rows * row_bytes, f"a table of {n_rows} values of attribute {name!r}")
    along = along_faces(DOMAINS[domain], rows, surface, faces)
    values = decode_table(packed, (n_rows, width), VALUE_TYPES[number_type], along)
    if rows is None:
        return Attribute(name, KINDS[kind], DOMAINS[domain], values)
    if layout == SHARED:
        return Attribute(name, KINDS[kind], DOMAINS[domain], values[rows])
    return Attribute(name, KINDS[kind], DOMAINS[domain], values, rows.astype(np.int32))


def _read_rows(
    payload: bytes, position: int, domain: Domain, surface: Surface, faces: Faces, n_verts: int
) -> tuple[int, int, Integers | None, bytes]:
    """Layout, number of rows, the row of each item (None: its own), and what follows."""
    if position >= len(payload) or payload[position] not in (EACH, INDEXED, SHARED):
        raise CorruptStreamError("it is not known how the values of an attribute are laid out")
    layout = payload[position]
    n_rows, position = read_varint(payload, position + 1)
    size_bytes, position = read_varint(payload, position)
    coded, packed = payload[position : position + size_bytes], payload[position + size_bytes :]
    n_items = surface.n_items(domain, n_verts, len(faces))
    if layout == EACH:
        if n_rows != n_items or coded:
            raise CorruptStreamError(f"an attribute has {n_rows} values for {n_items} places")
        return layout, n_rows, None, packed
    rows = decode_references(coded, places_of(domain, surface, faces, n_items))
    if len(rows) and not 0 <= rows.min() <= rows.max() < n_rows:
        raise CorruptStreamError("an attribute refers to a value that does not exist")
    return layout, n_rows, rows, packed


def _write_groups(groups: FaceGroups) -> bytes:
    labels = write_varint(len(groups.labels)) + b"".join(map(write_text, groups.labels))
    return write_text(groups.name) + labels + encode_integers([np.diff(groups.numbers, prepend=0)])


def _read_groups(payload: bytes, n_faces: int) -> FaceGroups:
    name, position = read_text(payload, 0)
    n_labels, position = read_varint(payload, position)
    if n_labels > len(payload):
        raise CorruptStreamError(f"{n_labels} labels are announced in {len(payload)} bytes")
    labels = []
    for _ in range(n_labels):
        label, position = read_text(payload, position)
        labels.append(label)
    (differences,) = decode_integers(payload[position:], [n_faces])
    numbers = np.cumsum(differences)
    if n_faces and not -1 <= numbers.min() <= numbers.max() < n_labels:
        raise CorruptStreamError(f"groups {name!r} refer to a group that does not exist")
    return FaceGroups(name, tuple(labels), numbers.astype(np.int32))


def _write_parts(parts: tuple[Part, ...]) -> bytes:
    return write_varint(len(parts)) + b"".join(
        write_varint(part.n_verts) + write_varint(part.n_faces) + write_text(part.name)
        for part in parts
    )


def _read_parts(payload: bytes) -> list[Part]:
    n_parts, position = read_varint(payload, 0)
    if n_parts > len(payload):
        raise CorruptStreamError(f"{n_parts} parts are announced in {len(payload)} bytes")
    parts = []
    for _ in range(n_parts):
        n_verts, position = read_varint(payload, position)
        n_faces, position = read_varint(payload, position)
        name, position = read_text(payload, position)
        parts.append(Part(name, n_verts, n_faces))
    if position != len(payload):
        raise CorruptStreamError(f"{len(payload) - position} bytes follow the last part")
    return parts


def _write_hard_edges(surface: Surface, faces: Faces) -> bytes:
    edges = _shared_edges(surface, faces)
    numbers = np.flatnonzero(hard_flags(surface.hard_edges, edges))
    return write_varint(len(numbers)) + encode_integers([np.diff(numbers, prepend=-1) - 1])


def _read_hard_edges(payload: bytes, surface: Surface, faces: Faces) -> npt.NDArray[np.int32]:
    n_hard, position = read_varint(payload, 0)
    ends = _shared_edges(surface, faces).ends
    if not 1 <= n_hard <= len(ends):
        raise CorruptStreamError(f"{n_hard} of {len(ends)} edges between faces are hard")
    (between,) = decode_integers(payload[position:], [n_hard])
    numbers = np.cumsum(between + 1) - 1
    if between.min() < 0 or numbers[-1] >= len(ends):
        raise CorruptStreamError("a hard edge is none of those between faces")
    return np.asarray(ends[numbers], np.int32)


def _shared_edges(surface: Surface, faces: Faces) -> SharedEdges:
    counts = surface.sizes(len(faces))
    return shared_edges(counts, join_fans(counts, faces))
