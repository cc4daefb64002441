"""Sections of a stream: id, length, payload and a checksum of all three."""

import struct
import zlib
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
    body = bytes([section]) + write_varint(len(payload)) + payload
    return body + _CHECKSUM.pack(zlib.crc32(body))


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
    if position >= size_bytes:
        raise TruncatedStreamError(f"the stream ends at byte {size_bytes}, before its end marker")
    file.seek(position)
    head = file.read(1 + MAX_BYTES)
    number = head[0]
    length, start = read_varint(head, 1)
    behind = position + start + length + _CHECKSUM.size
    if behind > size_bytes:
        raise TruncatedStreamError(
            f"the stream ends at byte {size_bytes}; section {_name(number)} at byte {position} "
            f"needs {behind - size_bytes} more bytes"
        )
    file.seek(position)
    data = file.read(behind - position)
    body, checksum = data[: -_CHECKSUM.size], data[-_CHECKSUM.size :]
    if _CHECKSUM.pack(zlib.crc32(body)) != checksum:
        raise CorruptStreamError(
            f"the checksum of section {_name(number)} at byte {position} does not match; "
            "the file is damaged"
        )
    if number in list(Section):
        return StoredSection(Section(number), body[start:], len(data)), behind
    if number & OPTIONAL:
        return None, behind
    raise UnsupportedVersionError(
        f"section {number} at byte {position} is required and unknown to this build; "
        "upgrade meshreel"
    )


def _name(number: int) -> str:
    return Section(number).name if number in list(Section) else str(number)
