"""A whole stream from its parts."""

from collections.abc import Iterable

from meshreel.bitstream.header import Header, write_header
from meshreel.bitstream.layout import MAX_POSITIONS_PER_BYTE, Section
from meshreel.bitstream.sections import write_section


def write_stream(header: Header, sections: Iterable[tuple[Section, bytes]]) -> bytes:
    """The bytes of a stream: header, sections, padding where needed, end marker."""
    body = write_header(header) + b"".join(write_section(*section) for section in sections)
    return body + _padding(header, len(body)) + write_section(Section.END, b"")


def _padding(header: Header, size_bytes: int) -> bytes:
    """What brings a stream up to the least size that its counts need."""
    missing = least_size_bytes(header) - size_bytes
    return write_section(Section.PADDING, bytes(missing)) if missing > 0 else b""


def least_size_bytes(header: Header) -> int:
    """Bytes below which a reader refuses the counts of this header."""
    largest = max(header.n_frames * header.n_verts, header.n_faces)
    return -(-largest // MAX_POSITIONS_PER_BYTE)
