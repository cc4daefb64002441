"""The container of a stream: header, sections with checksums, index, and their writer.

Integers of variable length are LEB128: 7 bits per byte, low bits first.
"""

import struct
import zlib
from collections.abc import Iterable, Sequence
from ctypes import c_float
from dataclasses import dataclass
from decimal import Decimal
from hashlib import blake2b
from io import BytesIO
from itertools import chain, islice, starmap, takewhile
from typing import BinaryIO

from meshreel.codec.bitstream.layout import (
    APPEARANCE_SECTIONS,
    FORMAT_VERSION,
    INDEX_POSITION,
    MAGIC,
    MAX_NAME_BYTES,
    MESH_SECTIONS,
    Section,
    VertexType,
)
from meshreel.errors import CorruptStreamError, TruncatedStreamError

Sections = Iterable[tuple[Section, bytes]]

_IS_DOUBLE, _IS_PLACED_BY_DOUBLES, _IS_COMPACT = 1, 32, 64
_ORDER_SHIFT, _LAPLACIAN_SHIFT = 1, 3
_MAX_RATE = 2**32
_MAX_DECIMALS, _DECIMAL_END = 22, 2**42  # so that a decimal takes at most 7 bytes
_CHECKSUM = struct.Struct("<I")
_COUNTS = struct.Struct("<II")

MIN_FRAMING = 6
"""Bytes of a section without its payload, if that has fewer than 128 bytes."""

MAX_COMPACT = 1024
"""Size in bytes up to which a stream of one block is compact: one checksum, no index."""

MAX_SHARED = 255
"""Maximum number of sections of a mesh that a segment shares with an earlier one."""

MAX_VARINT_BYTES = 9
"""Longest variable-length integer: its 63 bits fit a signed 64-bit integer."""


def write_varint(value: int) -> bytes:
    """Encode an integer of 0..2^63-1 with 7 bits per byte, low bits first (LEB128)."""
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def write_varints(*values: int) -> bytes:
    """Encode several integers as `write_varint` encodes each."""
    return b"".join(map(write_varint, values))


def read_varint(data: bytes | memoryview, position: int) -> tuple[int, int]:
    """Return the integer at a byte position, and the position after it.

    Raises
    ------
    TruncatedStreamError
        If the data end inside it.
    CorruptStreamError
        If it is longer than 9 bytes.
    """
    value = 0
    for k in range(MAX_VARINT_BYTES):
        if position + k >= len(data):
            raise TruncatedStreamError(f"an integer at byte {position} is cut off")
        byte = data[position + k]
        value |= (byte & 0x7F) << (7 * k)
        if byte < 0x80:
            return value, position + k + 1
    raise CorruptStreamError(
        f"the integer at byte {position} is longer than {MAX_VARINT_BYTES} bytes"
    )


def write_number(value: float) -> bytes:
    """Encode a finite number: as a decimal if that is exact and shorter, otherwise as a double."""
    sign, digits, exponent = Decimal(repr(float(value))).normalize().as_tuple()
    n_decimals, whole = max(-int(exponent), 0), int("".join(map(str, digits)))
    whole *= 10 ** max(int(exponent), 0)
    is_decimal = not sign and n_decimals <= _MAX_DECIMALS and whole < _DECIMAL_END
    return bytes([n_decimals]) + write_varint(whole) if is_decimal else _pack("d", value)


def error_bound_sections(percent: float | None) -> list[tuple[Section, bytes]]:
    """Return the section that states a guaranteed bound; none without one, or if it is 0."""
    return [(Section.ERROR_BOUND, write_number(percent))] if percent else []


def write_text(text: str) -> bytes:
    """Return the length of a text in UTF-8, in bytes, and its bytes."""
    data = text.encode("utf-8", errors="replace")
    return write_varint(len(data)) + data


def write_block_counts(n_frames: int, n_modes: int) -> bytes:
    """Return the payload of the section BLOCK: numbers of frames and modes."""
    return write_varints(n_frames, n_modes)


def read_block_counts(payload: bytes) -> tuple[int, int]:
    """Return the numbers of frames and modes that `write_block_counts` wrote.

    Raises
    ------
    CorruptStreamError
        If there are no frames, or bytes are left over.
    """
    n_frames, position = read_varint(payload, 0)
    n_modes, position = read_varint(payload, position)
    if not n_frames or position != len(payload):
        raise CorruptStreamError(
            f"a block announces {n_frames} frames, at least 1 is needed, and has "
            f"{len(payload) - position} bytes left over"
        )
    return n_frames, n_modes


def payload_bytes(sections: Sections) -> int:
    """Return the bytes of the payloads of sections."""
    return sum(len(payload) for _, payload in sections)


def write_sections(sections: Sequence[tuple[Section, bytes]]) -> list[bytes]:
    """Encode each section: id, length, payload, and a checksum of all three."""
    return [_with_checksum(_without_checksum(*section)) for section in sections]


def _without_checksum(section: Section, payload: bytes) -> bytes:
    return bytes([section]) + write_varint(len(payload)) + payload


def _with_checksum(data: bytes) -> bytes:
    return data + _CHECKSUM.pack(zlib.crc32(data))


@dataclass(frozen=True)
class Header:
    """The header of a stream, or of the first of its segments."""

    n_frames: int
    """Total over all segments; 0 if it was unknown when the header was written. The index then has
    the number of frames of each block.
    """
    n_verts: int
    n_faces: int
    """At least 1 each."""
    fps: float
    """Frames per second; 0 if unknown."""
    vertex_type: VertexType
    """Number type of the positions, in the input and in the decoded output."""
    method: int
    """Code of the method (`codec.method_names`)."""
    laplacian: int
    """A `layout.Laplacian`."""
    order: int
    """A `layout.Order`."""
    origin: tuple[float, ...]
    """Center of the model, in model units: x, y and z."""
    scale: float
    """Diagonal of the bounding box in model units, the unit of all other lengths in the stream."""
    name: str = ""
    """At most `MAX_NAME_BYTES` in UTF-8."""


def write_header(header: Header) -> bytes:
    """Encode a header, with its checksum."""
    return _with_checksum(_header(header))


def _header(header: Header, *, is_compact: bool = False) -> bytes:
    """Encode a header without its checksum."""
    name = header.name.encode("utf-8", errors="replace")[:MAX_NAME_BYTES]
    name = name.decode("utf-8", errors="ignore").encode()  # drop a character that the cut split
    is_integer = 0.0 <= header.fps < _MAX_RATE and header.fps == int(header.fps)
    rate = write_varint(1 + int(header.fps)) if is_integer else b"\0" + _pack("d", header.fps)
    return (
        MAGIC
        + bytes([FORMAT_VERSION])
        + write_varints(header.n_frames, header.n_verts, header.n_faces)
        + rate
        + _codes(header, is_compact=is_compact)
        + _placement(header)
        + write_varint(len(name))
        + name
    )


def write_segment(header: Header, first: Header) -> bytes:
    """Return the payload of the section SEGMENT: a header without the fields that segments share.

    Parameters
    ----------
    header : Header
        The header of the segment; name, number of frames and frame rate are not stored.
    first : Header
        The header of the stream; origin and scale are stored only if they differ from it.
    """
    payload = write_varints(header.n_verts, header.n_faces) + _codes(header)
    is_placed = (header.origin, header.scale) != (first.origin, first.scale)
    return payload + _placement(header) if is_placed else payload


def _codes(header: Header, *, is_compact: bool = False) -> bytes:
    """Return the codes of the method and of the form of the numbers."""
    form = _IS_DOUBLE * (header.vertex_type == VertexType.FLOAT64) | _IS_COMPACT * is_compact
    form |= header.order << _ORDER_SHIFT | header.laplacian << _LAPLACIAN_SHIFT
    form |= _IS_PLACED_BY_DOUBLES * (not _is_placed_by_floats(header))
    return bytes([header.method, form])


def _placement(header: Header) -> bytes:
    """Return origin and scale, in single precision if that is exact."""
    return _pack("f" if _is_placed_by_floats(header) else "d", *header.origin, header.scale)


def _is_placed_by_floats(header: Header) -> bool:
    return all(c_float(number).value == number for number in (*header.origin, header.scale))


def _pack(number_type: str, *numbers: float) -> bytes:
    return struct.pack(f"<{len(numbers)}{number_type}", *numbers)


class StoredMeshes:
    """The meshes that the segments of a stream store so far, for references to them.

    Only digests of their sections are kept.
    """

    def __init__(self) -> None:
        self._prefixes: dict[bytes, int] = {}
        """Segment that stores a sequence of leading sections, by the digest of the sections."""
        self._appearances: dict[bytes, tuple[int, int]] = {}
        """Segment that stores materials and images, by their digest, and the number of its sections
        that precede them."""

    def share(self, number: int, header: Header, leading: Sections) -> list[tuple[Section, bytes]]:
        """Return the leading sections of a segment, with a reference if that takes fewer bytes.

        Parameters
        ----------
        number : int
            Number of the segment, from 0; numbers ascend from call to call.
        leading : iterable of (Section, bytes)
            The sections before its first block.
        """
        all_sections = list(leading)
        mesh = [section for section in all_sections if section[0] in MESH_SECTIONS]
        stored, ranges = mesh, b""
        counts = header.n_verts, header.n_faces
        for section, payload in mesh:
            if section is Section.EDIT:  # CONNECTIVITY then describes another mesh
                n_verts, after = read_varint(payload, 0)
                counts = n_verts, read_varint(payload, after)[0]
        state, digests = blake2b(_COUNTS.pack(*counts), digest_size=16), []  # of 1, 2, ... sections
        constant = takewhile(lambda part: part[0] != Section.ATTRIBUTE_FROM_POINTS, mesh)
        for part in islice(constant, MAX_SHARED):
            state.update(_without_checksum(*part))
            digests.append(state.digest())
        n_shared = sum(digest in self._prefixes for digest in digests)
        if n_shared:
            distance = number - self._prefixes[digests[n_shared - 1]]
            stored, ranges = _without(stored, 0, n_shared, distance)
        is_new = not ranges
        n_before = sum(section not in APPEARANCE_SECTIONS for section, _ in stored)
        appearance = stored[n_before:]
        earlier = self._appearances.get(_digest_of(appearance)) if appearance else None
        if earlier:
            source, n_before_source = earlier
            shared = n_before, len(appearance), number - source, n_before_source
            stored, appearance_range = _without(stored, *shared)
            ranges += appearance_range
        if is_new:
            for digest in digests[: len(stored)]:
                self._prefixes.setdefault(digest, number)
        if appearance and len(stored) > n_before and n_before + len(appearance) <= MAX_SHARED:
            self._appearances.setdefault(_digest_of(appearance), (number, n_before))
        if not ranges:
            return all_sections
        others = (section for section in all_sections if section[0] not in MESH_SECTIONS)
        return [(Section.REFERENCE, ranges), *stored, *others]


def _without(
    sections: list[tuple[Section, bytes]],
    start: int,
    n_shared: int,
    distance: int,
    n_skipped: int = 0,
) -> tuple[list[tuple[Section, bytes]], bytes]:
    """Return the sections that are not shared, and the range of a REFERENCE to the shared ones.

    Returns all sections and no range if that takes fewer bytes.
    """
    numbers = write_varints(distance, n_skipped, n_shared)
    shared = sections[start : start + n_shared]
    saved = sum(len(payload) + MIN_FRAMING for _, payload in shared)
    if len(numbers) + MIN_FRAMING >= saved:
        return sections, b""
    return sections[:start] + sections[start + n_shared :], numbers


def _digest_of(sections: Sections) -> bytes:
    """Return a digest of sections that fit any mesh."""
    return blake2b(b"".join(starmap(_without_checksum, sections)), digest_size=16).digest()


@dataclass(frozen=True)
class BlockEntry:
    """Position and size of a block of frames in a stream."""

    n_frames: int
    """At least 1."""
    position: int
    """Byte offset of its first section in the stream."""
    sizes: tuple[int, ...]
    """Size in bytes of the sections of each track, starting with the positions; at least 1 each."""


@dataclass(frozen=True)
class SegmentEntry:
    """Position of a segment after the first, and its blocks."""

    n_verts: int
    n_faces: int
    position: int
    """Byte offset of its section SEGMENT, which is the end of the previous segment."""
    entries: Sequence[BlockEntry]
    """At least 1."""


def write_index(entries: Sequence[BlockEntry], further: Sequence[SegmentEntry] = ()) -> bytes:
    """Return the payload of the section INDEX; blocks are contiguous and end at the index.

    Parameters
    ----------
    entries : sequence of BlockEntry
        Blocks of the first segment.
    further : sequence of SegmentEntry
        All further segments.
    """
    numbers = [entries[0].position if entries else 0, *_numbers_of(entries)]
    for segment in further:
        first = segment.entries[0]
        numbers += [segment.n_verts, segment.n_faces, len(first.sizes)]
        numbers += [first.position - segment.position, *_numbers_of(segment.entries)]
    return write_varints(*numbers)


def _numbers_of(entries: Sequence[BlockEntry]) -> list[int]:
    """Return the number of blocks, then the frames of each block and the bytes of each track."""
    return [len(entries), *chain.from_iterable((entry.n_frames, *entry.sizes) for entry in entries)]


class StreamWriter:
    """Writes a stream to a file: for each segment its header and leading sections, then blocks.

    Written bytes never change: after an interruption the file is readable up to the last block.

    Parameters
    ----------
    file : binary file, open for writing
        Written sequentially, without seeking.

    Attributes
    ----------
    size_bytes : int
        Bytes written so far.
    """

    def __init__(self, file: BinaryIO) -> None:
        self.size_bytes: int = 0
        self._file = file
        self._header: Header | None = None  # of the stream
        self._entries: list[list[BlockEntry]] = []
        self._further: list[SegmentEntry] = []
        self._meshes = StoredMeshes()

    def begin_segment(self, header: Header, leading: Sections) -> None:
        """Begin a mesh; its frames follow those of the blocks written so far.

        If an earlier segment has the same mesh, a reference is written in its place.

        Parameters
        ----------
        header : Header
            That of the first segment is the header of the stream; its number of frames is 0 if it
            is still unknown. Name, number of frames and frame rate of others are not stored.
        leading : iterable of (Section, bytes)
            The sections before its first block, without START unless it is the first segment.
        """
        sections = self._meshes.share(len(self._entries), header, leading)
        self._entries.append([])
        if self._header is None:
            self._header = header
            self._write(write_header(header))
        else:
            counts = header.n_verts, header.n_faces
            self._further.append(SegmentEntry(*counts, self.size_bytes, self._entries[-1]))
            sections = [(Section.SEGMENT, write_segment(header, self._header)), *sections]
        self._write(b"".join(write_sections(sections)))

    def write_block(self, n_frames: int, sections: Sections) -> None:
        """Write a block and flush the file.

        Parameters
        ----------
        sections : iterable of (Section, bytes)
            BLOCK first and COEFFICIENTS last, so that a block is complete if its last section is.
            Each TRACK_BLOCK starts the sections of a further track.
        """
        parts = list(sections)
        encoded, start, sizes = write_sections(parts), self.size_bytes, [0]
        for (section, _), data in zip(parts, encoded, strict=True):
            if section is Section.TRACK_BLOCK:
                sizes.append(0)
            sizes[-1] += len(data)
        self._write(b"".join(encoded))
        self._file.flush()
        self._entries[-1].append(BlockEntry(n_frames, start, tuple(sizes)))

    def finish(self, trailing: Sections = ()) -> None:
        """Write sections that follow the blocks, the index, and the end marker."""
        self._write(b"".join(write_sections(list(trailing))))
        index = write_index(self._entries[0], self._further)
        position = INDEX_POSITION.pack(self.size_bytes)
        self._write(b"".join(write_sections([(Section.INDEX, index), (Section.END, position)])))
        self._file.flush()

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self.size_bytes += len(data)


Segment = tuple[Header, Sections, Iterable[tuple[int, Sections]]]
"""Header, sections before the first block, and number of frames and sections of each block."""


def write_stream(*segments: Segment) -> bytes:
    """Encode a stream of at least one segment.

    A single segment of one block is compact if it then has at most `MAX_COMPACT` bytes.
    """
    (header, sections, blocks), *further = segments
    leading, blocks = list(sections), iter(blocks)
    first = [(n_frames, list(sections)) for n_frames, sections in islice(blocks, 2)]
    if not further and len(first) == 1:
        sections = [*leading, *first[0][1]]
        if payload_bytes(sections) <= MAX_COMPACT:
            encoded = starmap(_without_checksum, [*sections, (Section.END, b"")])
            data = _with_checksum(_header(header, is_compact=True) + b"".join(encoded))
            if len(data) <= MAX_COMPACT:
                return data
    file = BytesIO()
    writer = StreamWriter(file)
    for segment, sections, segment_blocks in [(header, leading, chain(first, blocks)), *further]:
        writer.begin_segment(segment, sections)
        for block in segment_blocks:
            writer.write_block(*block)
    writer.finish()
    return file.getvalue()
