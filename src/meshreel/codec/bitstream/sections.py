"""Sections of a stream: id, length, payload and a checksum of all three."""

import struct
import zlib
from collections.abc import Sequence

from meshreel.codec.bitstream.layout import Section
from meshreel.codec.entropy.varint import write_varint

_CHECKSUM = struct.Struct("<I")


def write_sections(sections: Sequence[tuple[Section, bytes]]) -> list[bytes]:
    """The bytes of each section, checksums included."""
    written = []
    for section, payload in sections:
        body = bytes([section]) + write_varint(len(payload)) + payload
        written.append(body + _CHECKSUM.pack(zlib.crc32(body)))
    return written
