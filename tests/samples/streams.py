"""Streams put together from sections, sound or not, without an index."""

from meshreel.bitstream.header import write_header
from meshreel.bitstream.layout import Section
from meshreel.bitstream.sections import write_section


def raw_stream(header, sections):
    """The bytes of a header, these sections and an end marker."""
    parts = [write_section(*section) for section in (*sections, (Section.END, b""))]
    return write_header(header) + b"".join(parts)


def parts_of(stream):
    """Sections of a stream as pairs of id and payload, without index and end."""
    return [
        (stored.id, stored.payload)
        for stored in stream.sections()
        if stored.id not in (Section.INDEX, Section.END)
    ]
