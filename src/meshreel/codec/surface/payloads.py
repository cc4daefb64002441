"""Encoding of the sections of a surface: polygons, attributes, groups, parts, materials."""

import struct
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import write_text, write_varint, write_varints
from meshreel.codec.bitstream.layout import Order, Section
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.entropy.tables import encode_grid_table, encode_table
from meshreel.codec.surface.codes import ALPHA_MODES, CHANNELS, DOMAINS, FILTERS, KINDS, WRAPS
from meshreel.codec.surface.rows import (
    distinct_rows,
    encode_corner_references,
    encode_references,
    faces_of_rows,
    sharing_groups,
)
from meshreel.codec.surface.uv_grid import is_quantized, uv_integers
from meshreel.errors import InvalidInputError, Keyword, Message
from meshreel.kernel.integers import encode_integers
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.cells import Cells
from meshreel.model.geometry.hard_edges import hard_flags, shared_edges
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.geometry.triangles import matching_corners
from meshreel.model.materials import SLOTS, Material, Texture
from meshreel.model.notes import Note, NoteKind
from meshreel.model.surface import PLAIN, VALUE_TYPES, Attribute, Domain, Surface

Integers = npt.NDArray[np.integer]
Faces = npt.NDArray[np.int32]
Positions = npt.NDArray[np.floating]
Appearance = Material | Texture

PER_ITEM, INDEXED, SHARED = range(3)
"""Layouts of values: one row per item; indexed rows; or rows that corners share in the stream and
that are expanded to one row per item on decoding."""

MANY_CORNERS, MAX_DISTINCT_SHARE = 30_000, 0.5
"""With more corners than this, and less than this share of distinct rows, separate rows for all
corners are not tried."""

MATERIAL_NUMBERS = {
    "base_color": 4,
    "metallic": 1,
    "roughness": 1,
    "emissive": 3,
    "normal_scale": 1,
    "occlusion_strength": 1,
    "alpha_cutoff": 1,
}
TEXTURE_NUMBERS = {"offset": 2, "rotation": 1, "scale": 2}
"""Numeric fields in the order of the stream, with their sizes."""

DOUBLE_SIDED, UNLIT = 4, 8
NUMBER = struct.Struct("<d")


def surface_sections(
    surface: Surface, faces: Faces, uv_bits: int | None = None
) -> Iterator[tuple[Section, bytes]]:
    """Yield the sections of the surface of a mesh; none if it is plain.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
        Triangles in output order.
    uv_bits : int, optional
        Bits of the grid of texture coordinates. Default: they are exact.

    Raises
    ------
    InvalidInputError
        If a hard edge has fewer than two faces.
    """
    if surface.face_sizes is not None and surface.cells is None:
        sizes = surface.face_sizes
        yield Section.POLYGONS, write_varint(len(sizes)) + encode_integers([sizes - 3])
    for attribute in surface.attributes:
        yield Section.ATTRIBUTE, write_attribute(attribute, surface, faces, uv_bits)
    for groups in surface.groups:
        head = write_text(groups.name) + write_varint(len(groups.labels))
        labels = b"".join(map(write_text, groups.labels))
        yield Section.GROUPS, head + labels + encode_integers([np.diff(groups.numbers, prepend=0)])
    if surface.parts:
        rows = (
            write_varints(part.n_verts, part.n_faces) + write_text(part.name)
            for part in surface.parts
        )
        yield Section.PARTS, write_varint(len(surface.parts)) + b"".join(rows)
    if surface.hard_edges is not None:
        sizes = surface.sizes(len(faces))
        edges = shared_edges(sizes, join_triangles(sizes, faces))
        numbers = np.flatnonzero(hard_flags(surface.hard_edges, edges))
        gaps = encode_integers([np.diff(numbers, prepend=-1) - 1])
        yield Section.HARD_EDGES, write_varint(len(numbers)) + gaps
    for material in surface.materials:
        yield Section.MATERIAL, write_material(material)
    for image in surface.images:
        yield Section.IMAGE, write_text(image.name) + write_text(image.mime_type) + image.data


def surface_in_order(
    surface: Surface, order: Order, faces: Faces, output_faces: Faces, internal_to_given: Integers
) -> Surface:
    """Return a surface for the order in which a stream returns vertices and faces.

    Unless the order of faces is kept, polygons become triangles and parts are lost; attributes of
    faces and corners, groups and materials follow their triangles.

    Parameters
    ----------
    faces, output_faces : int32 arrays of shape (M, 3)
        The given and the decoded triangles.
    internal_to_given : integer array of shape (V,)
        Given number of each internal vertex.
    """
    if order is Order.KEEP or surface is PLAIN:
        return surface
    hard_edges, vertices = surface.hard_edges, np.arange(len(internal_to_given))
    if order is Order.DROP:
        vertices = inverse_permutation(internal_to_given)
        if hard_edges is not None:
            hard_edges = vertices.astype(np.int32)[hard_edges]
    first_corners = matching_corners(output_faces, vertices[faces], len(vertices))
    triangles, turns = first_corners // 3, first_corners[:, None] + np.arange(3)
    corners = 3 * triangles[:, None] + turns % 3
    sizes = surface.sizes(len(faces))
    polygons = np.repeat(np.arange(len(sizes)), sizes - 2)[triangles]
    numbers: dict[Domain, Integers] = {
        Domain.VERTEX: np.argsort(vertices),
        Domain.FACE: polygons,
        Domain.CORNER: triangle_corners(sizes, faces).ravel()[corners.ravel()],
    }
    return replace(
        surface,
        face_sizes=None,
        attributes=tuple(_reordered(row, numbers[row.domain]) for row in surface.attributes),
        groups=tuple(replace(row, numbers=row.numbers[polygons]) for row in surface.groups),
        parts=(),
        hard_edges=hard_edges,
    )


def surface_of_internal_cells(
    surface: Surface, cells: Cells, internal_to_given: Integers, given_cells: Integers
) -> Surface:
    """Return a surface for a stream that returns vertices and cells in internal order.

    Parameters
    ----------
    cells : Cells
        In internal order.
    internal_to_given, given_cells : integer arrays of shape (V,) and (N,)
        Given vertex and cell of each internal one.

    Raises
    ------
    InvalidInputError
        If it has attributes of faces or corners, groups, parts or hard edges, which need the order
        of cells.
    """
    numbers = {Domain.VERTEX: internal_to_given, Domain.CELL: given_cells}
    unsupported = [row.name for row in surface.attributes if row.domain not in numbers]
    unsupported += [groups.name for groups in surface.groups]
    unsupported += ["parts"] if surface.parts else []
    unsupported += ["hard edges"] if surface.hard_edges is not None else []
    if unsupported:
        raise InvalidInputError(
            f"{', '.join(unsupported)} need the order of cells; keep it with ",
            Keyword("order", "keep"),
        )
    attributes = tuple(_reordered(row, numbers[row.domain]) for row in surface.attributes)
    return replace(surface, face_sizes=None, attributes=attributes, cells=cells)


def order_notes(surfaces: Iterable[Surface], order_names: str, *, is_chosen: bool) -> list[Note]:
    """Describe what a stream omits of its surfaces because it does not keep the order of elements.

    Parameters
    ----------
    order_names : str
        The orders that its segments keep, as in `StreamInfo`.
    is_chosen : bool
        Whether the user has chosen the order, one for all segments.
    """
    orders = [Order[name] for name in order_names.upper().split(", ")]
    if not is_chosen:
        if Order.DROP not in orders:
            return []
        text = Message(
            "omitted: the order of vertices and faces, which has no meaning in these files (",
            Keyword("order", "keep"),
            " keeps it)",
        )
        return [Note(NoteKind.UNWRITTEN, "order", text=text)]
    (order,) = orders
    texts = dict.fromkeys(order_loss_note(surface, order) for surface in surfaces)
    return [Note(NoteKind.UNWRITTEN, text) for text in texts if text]


def order_loss_note(surface: Surface, order: Order) -> str:
    """Describe what a stream with this choice of order omits; possibly empty."""
    if order is Order.KEEP:
        return ""
    lost = ["polygons"] if surface.face_sizes is not None else []
    lost += ["parts"] if surface.parts else []
    return f"omitted, since the order of faces is not kept: {' and '.join(lost)}" if lost else ""


def _reordered(attribute: Attribute, numbers: Integers) -> Attribute:
    """Return an attribute whose item i is the given item ``numbers[i]``."""
    if attribute.domain is Domain.CORNER:  # rows in a new order take more bytes than they save
        return replace(attribute, values=attribute.per_item()[numbers], indices=None)
    if attribute.indices is not None:
        return replace(attribute, indices=attribute.indices[numbers])
    return replace(attribute, values=attribute.values[numbers])


def write_attribute(
    attribute: Attribute,
    surface: Surface,
    faces: Faces,
    uv_bits: int | None,
    positions: Positions | None = None,
) -> bytes:
    """Encode an attribute; with positions of the vertices, predicted from these."""
    domain = attribute.domain
    kind, code = KINDS.index(attribute.kind), DOMAINS.index(domain)
    number_type = VALUE_TYPES.index(attribute.values.dtype)
    head = bytes([kind, code, number_type, attribute.values.shape[1]]) + write_text(attribute.name)
    indices = attribute.indices
    bits = uv_bits if is_quantized(attribute) else None
    values = attribute.values if bits is None else uv_integers(attribute, bits)
    groups = sharing_groups(domain, surface, faces, len(values if indices is None else indices))

    def encoded(layout: int, rows: Integers | None, table: npt.NDArray[Any]) -> bytes:
        references = b""
        if rows is not None and domain is Domain.CORNER:
            references = encode_corner_references(rows, surface, faces)
        elif rows is not None:
            references = encode_references(rows)
        counts = bytes([layout]) + write_varints(len(table), len(references))
        row_faces, points = faces_of_rows(domain, rows, surface, faces), None
        if positions is not None and row_faces is not None:
            points = np.zeros((len(table), 3))
            points[row_faces.ravel()[::-1]] = positions[faces.ravel()[::-1]]  # of first corners
        if bits is None:
            return counts + references + encode_table(table, row_faces, points)
        return counts + references + encode_grid_table(table, bits, row_faces, points)

    if indices is not None:
        return head + encoded(INDEXED, indices, values)
    if domain is not Domain.CORNER:
        return head + encoded(PER_ITEM, None, values)
    first, rows = distinct_rows(values, groups)
    shared = encoded(SHARED, rows, values[first])
    if len(rows) > MANY_CORNERS and len(first) < MAX_DISTINCT_SHARE * len(rows):
        return head + shared
    return head + min(encoded(PER_ITEM, None, values), shared, key=len)


def write_material(material: Material) -> bytes:
    """Encode a material; default values take no bytes."""
    flags = ALPHA_MODES.index(material.alpha_mode)
    flags |= DOUBLE_SIDED * material.double_sided | UNLIT * material.unlit
    numbers = _write_numbers(material, Material(""), MATERIAL_NUMBERS)
    slots = sum(1 << SLOTS.index(slot) for slot in material.textures)
    payload = write_text(material.name) + bytes([flags]) + numbers + bytes([slots])
    for texture in material.textures.values():
        channels = sum(1 << CHANNELS.index(channel) for channel in texture.channels)
        wraps = WRAPS.index(texture.wrap_u) | WRAPS.index(texture.wrap_v) << 4
        magnified, shrunk = (
            0 if filter_ is None else 1 + FILTERS.index(filter_)
            for filter_ in (texture.magnified, texture.shrunk)
        )
        payload += write_varint(texture.image) + write_text(texture.uv)
        payload += bytes([channels, wraps, magnified | shrunk << 4])
        payload += _write_numbers(texture, Texture(0), TEXTURE_NUMBERS)
    return payload


def _write_numbers(appearance: Appearance, default: Appearance, sizes: dict[str, int]) -> bytes:
    """Encode a mask of the numbers that differ from the defaults, and these numbers."""
    pairs = list(zip(_numbers(appearance, sizes), _numbers(default, sizes), strict=True))
    changed = [number for number, (value, usual) in enumerate(pairs) if value != usual]
    mask = sum(1 << number for number in changed)
    return write_varint(mask) + b"".join(NUMBER.pack(pairs[number][0]) for number in changed)


def _numbers(appearance: Appearance, sizes: dict[str, int]) -> list[float]:
    values = [(getattr(appearance, name), size) for name, size in sizes.items()]
    return [number for value, size in values for number in ([value] if size == 1 else value)]
