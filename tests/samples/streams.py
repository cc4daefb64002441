"""Parsing of streams by the core, and assembly of valid and invalid ones."""

from functools import cached_property
from io import BytesIO
from unittest.mock import patch

import numpy as np

from conformance.reader import read_layout, read_track
from meshreel.codec.bitstream import container
from meshreel.codec.bitstream.container import Header, read_varint, write_header, write_sections
from meshreel.codec.bitstream.layout import Section, VertexType
from meshreel.codec.methods import method_named
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.reel.normative.fields import Layout
from meshreel.codec.streaming import Encoder
from meshreel.codec.surface.codes import DOMAINS
from meshreel.codec.tracks import KINDS, OF_CELLS, Coding, Sharing, TrackHeader
from meshreel.kernel.basis import BasisCoding, Rests
from meshreel.kernel.files import OpenFile
from meshreel.kernel.structures import NUMBER_TYPES
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track

FRAMES_AT = 9
"""Position of the number of frames in a header; 0 means unknown."""


def raw_stream(header, sections):
    """Return the bytes of a header, these sections and END."""
    return write_header(header) + b"".join(write_sections([*sections, (Section.END, b"")]))


def parts_of(stream):
    """Return the sections of a stream as pairs of id and payload, without INDEX and END."""
    return [part for part in stream.sections if part[0] not in (Section.INDEX, Section.END)]


def not_compact():
    """Context in which streams of any size have checksums of their sections, and an index."""
    return patch.object(container, "MAX_COMPACT", 0)


class Stream:
    """The parts of a stream, which may be truncated."""

    def __init__(self, data):
        self.file = OpenFile(data, float("inf"))

    @property
    def header(self):
        info = self.file.info
        n_frames, _ = read_varint(self.file.bytes_at(0, self.header_size_bytes), FRAMES_AT)
        return Header(
            n_frames, info.n_verts, info.n_triangles, info.fps, VertexType(info.number_bytes),
            info.method, info.laplacian, info.order, info.center, info.diagonal, info.name,
        )  # fmt: skip

    @property
    def header_size_bytes(self):
        return next(self.file.sections()).offset

    @cached_property
    def sections(self):
        """Return all known sections as pairs of id and payload."""
        return self._between(0, None)

    @cached_property
    def groups(self):
        """Return start and end of the bytes of each track in each block."""
        numbers = range(self.file.info.n_blocks), range(self.file.info.n_tracks)
        results = [
            [self.file.block(number, track) for track in numbers[1]] for number in numbers[0]
        ]
        return [[(one.offset, one.offset + one.size_bytes) for one in block] for block in results]

    def block(self, number, track=0):
        """Return the payloads of a track in a block by id."""
        return dict(self._between(*self.groups[number][track]))

    def _between(self, start, stop):
        return [
            (Section(section.id), self.file.bytes_at(section.payload_offset, section.payload_bytes))
            for section in self.file.sections(start, stop)
            if section.is_known
        ]


def layouts(data):
    """Return the layout of the positions in each block of `reel`, read by the plain reader."""
    stream = Stream(data)
    return [
        layout_of(stream.block(number), stream.file.block(number).n_frames)
        for number in range(len(stream.groups))
    ]


def layout_of(sections, n_frames):
    """Return the layout of the positions in a block, given its sections by id."""
    read = read_layout({section.name: data for section, data in sections.items()}, n_frames, 3)
    rests = Rests(tuple(map(tuple, read.get("rests", []))), read.get("rest bits", 0))
    return Layout(
        np.float32(read["step"]), read["stencil"], read["learned"], read["reference"],
        read["precision"] == 4, read.get("reused", 0), np.float32(read.get("finer", 0.0)),
        BasisCoding(rests, "cosines" in read, "adaptive" in read),
    )  # fmt: skip


def track_headers(data):
    payloads = [payload for section, payload in Stream(data).sections if section is Section.TRACK]
    return [track_header(payload) for payload in payloads]


def track_header(payload):
    """Return the header of a TRACK, read by the plain reader."""
    fields, placement = read_track(payload)
    code = fields["domain"]
    of_cells = code == OF_CELLS
    sharing = Sharing.NONE if of_cells else Sharing(max(0, code - DOMAINS.index(Domain.CORNER)))
    coding = Coding(fields["coding"])
    return TrackHeader(
        fields["name"],
        fields["unit"],
        KINDS[fields["kind"]],
        Domain.CELL if of_cells else DOMAINS[code - sharing],
        NUMBER_TYPES[placement.number_type],
        placement.scale,
        (0.0,) * 3 if coding.is_predicted else placement.origin,
        coding,
        fields["bound"],
        fields.get("rate", 0.0),
        sharing,
        fields.get("rows", b""),
    )


def track_values(data):
    opened, result = whole_stream(data), []
    reader = method_named(opened.method).frames(opened, None)
    for number, track in enumerate(opened.tracks, start=1):
        result.append(np.empty((opened.n_frames, track.n_items, track.n_columns), track.dtype))
        reader.fill(result[-1], 0, number)
    return result


def recorded(sequence, **options):
    """Return the stream of frames that are pushed one by one, with their tracks."""
    file = BytesIO()
    facts = {"fps": sequence.fps, "surface": sequence.surface, **options}
    with Encoder(sequence.faces, file, **facts) as encoder:
        for number, frame in enumerate(sequence.vertices):
            tracks = {
                name: Track(track.values[number : number + 1], track.domain, track.kind, track.unit)
                for name, track in sequence.tracks.items()
            }
            encoder.push(frame, tracks or None)
    return file.getvalue()
