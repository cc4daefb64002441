"""Sections: id, length, payload and a checksum of all three."""

import struct
import zlib
from dataclasses import dataclass

from meshreel.bitstream.layout import OPTIONAL, Section
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError, UnsupportedVersionError

_CHECKSUM = struct.Struct("<I")


@dataclass(frozen=True)
class StoredSection:
    """A section as it lies in the stream.

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


def read_section(data: bytes, position: int) -> tuple[StoredSection | None, int]:
    """The section at `position` and the position behind it.

    Returns None in place of an optional section that this build does not know.

    Raises
    ------
    TruncatedStreamError
        If the data end inside the section.
    CorruptStreamError
        If its checksum does not match.
    UnsupportedVersionError
        If it is required and unknown.
    """
    if position >= len(data):
        raise TruncatedStreamError(f"the stream ends at byte {len(data)}, before its end marker")
    number = data[position]
    length, start = read_varint(data, position + 1)
    end = start + length
    if end + _CHECKSUM.size > len(data):
        missing = end + _CHECKSUM.size - len(data)
        raise TruncatedStreamError(
            f"the stream ends at byte {len(data)}; section {_name(number)} at byte {position} "
            f"needs {missing} more bytes"
        )
    if zlib.crc32(data[position:end]) != _CHECKSUM.unpack_from(data, end)[0]:
        raise CorruptStreamError(
            f"the checksum of section {_name(number)} at byte {position} does not match; "
            "the file is damaged"
        )
    behind = end + _CHECKSUM.size
    if number in list(Section):
        return StoredSection(Section(number), data[start:end], behind - position), behind
    if number & OPTIONAL:
        return None, behind
    raise UnsupportedVersionError(
        f"section {number} at byte {position} is required and unknown to this build; "
        "upgrade meshreel"
    )


def _name(number: int) -> str:
    return Section(number).name if number in list(Section) else str(number)
