"""Sections of a stream: id, length, payload and a checksum of all three."""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO

from meshreel.bitstream.layout import INDEX_POSITION, OPTIONAL, Section
from meshreel.entropy.varint import MAX_BYTES, read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError

_CHECKSUM = struct.Struct("<I")

END_SIZE_BYTES = 2 + INDEX_POSITION.size + _CHECKSUM.size
"""Size of an end marker that points to the index."""


@dataclass(frozen=True)
class StoredSection:
    """A section as it is stored in the stream.

    Attributes
    ----------
    id : Section
    payload : bytes
    size_bytes : int
        Of the whole section: id, length, payload and checksum.
    """

    id: Section
    payload: bytes
    size_bytes: int


def write_section(section: Section, payload: bytes) -> bytes:
    """The bytes of a section, checksum included."""
    return write_sections([(section, payload)])[0]


def write_sections(sections: Sequence[tuple[Section, bytes]]) -> list[bytes]:
    """The bytes of each section, checksums included."""
    written = []
    for section, payload in sections:
        body = bytes([section]) + write_varint(len(payload)) + payload
        written.append(body + _CHECKSUM.pack(zlib.crc32(body)))
    return written


@dataclass(frozen=True)
class SectionHead:
    """A section by its id and length, without its payload.

    Attributes
    ----------
    number : int
        Its id, which this build need not know.
    payload_start : int
        Byte of the stream.
    payload_bytes, size_bytes : int
        Of the payload, and of the whole section.
    """

    number: int
    payload_start: int
    payload_bytes: int
    size_bytes: int

    @property
    def id(self) -> Section | None:
        """The id, if this build knows it."""
        return Section(self.number) if self.number in list(Section) else None


def read_head(file: BinaryIO, position: int, size_bytes: int) -> SectionHead:
    """The head of the section at `position` of a stream of this many bytes.

    Raises
    ------
    TruncatedStreamError
        If the stream ends inside the section.
    """
    if position >= size_bytes:
        raise TruncatedStreamError(f"the stream ends at byte {size_bytes}, before its end marker")
    file.seek(position)
    head = file.read(1 + MAX_BYTES)
    length, start = read_varint(head, 1)
    found = SectionHead(head[0], position + start, length, start + length + _CHECKSUM.size)
    behind = position + found.size_bytes
    if behind > size_bytes:
        raise TruncatedStreamError(
            f"the stream ends at byte {size_bytes}; section {_name(head[0])} at byte {position} "
            f"needs {behind - size_bytes} more bytes"
        )
    return found


def read_section(
    file: BinaryIO, position: int, size_bytes: int
) -> tuple[StoredSection | None, int]:
    """The section at `position` of a stream of this many bytes, and the position after it.

    Returns None in place of an optional section that this build does not know.

    Raises
    ------
    TruncatedStreamError
        If the stream ends inside the section.
    CorruptStreamError
        If its checksum does not match.
    UnsupportedVersionError
        If it is required and unknown.
    """
    head = read_head(file, position, size_bytes)
    number, behind = head.number, position + head.size_bytes
    file.seek(position)
    data = file.read(head.size_bytes)
    body, checksum = data[: -_CHECKSUM.size], data[-_CHECKSUM.size :]
    if _CHECKSUM.pack(zlib.crc32(body)) != checksum:
        raise CorruptStreamError(
            f"the checksum of section {_name(number)} at byte {position} does not match; "
            "the file is damaged"
        )
    if number in list(Section):
        payload = body[head.payload_start - position :]
        return StoredSection(Section(number), payload, len(data)), behind
    if number & OPTIONAL:
        return None, behind
    raise UnsupportedVersionError(
        f"section {number} at byte {position} is required and unknown to this build; "
        "upgrade meshreel"
    )


def _name(number: int) -> str:
    return Section(number).name if number in list(Section) else str(number)
