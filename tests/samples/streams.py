"""Streams put together from sections, sound or not, without an index."""

import numpy as np

from meshreel.bitstream.header import write_header
from meshreel.bitstream.layout import Section
from meshreel.bitstream.sections import write_section
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.tracks import read_track


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


def track_headers(data):
    """What a stream says of its tracks beside the positions."""
    opened = whole_stream(data)
    sections = (one for one in opened.leading if one.id == Section.TRACK)
    return [read_track(opened.payload(one)) for one in sections]


def track_values(data):
    """All values of all tracks beside the positions."""
    opened, found = whole_stream(data), []
    reader = opened.frames()
    for number, track in enumerate(opened.tracks, start=1):
        found.append(np.empty((opened.n_frames, track.n_items, track.n_columns), track.dtype))
        reader.fill(found[-1], 0, number)
    return found
