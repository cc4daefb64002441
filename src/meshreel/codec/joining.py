"""Join streams into a stream of several segments, and separate them again."""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from io import BytesIO

from meshreel.codec.bitstream.container import Header, StreamWriter
from meshreel.codec.bitstream.container import whole_stream as written_stream
from meshreel.codec.bitstream.layout import Section, VertexType
from meshreel.codec.open_stream import OpenStream, whole_stream
from meshreel.errors import InvalidInputError


def join_streams(streams: Sequence[bytes]) -> bytes:
    """Join streams into one whose segments are their meshes, without re-encoding.

    Name and start are those of the first stream.

    Parameters
    ----------
    streams : sequence of bytes
        Complete streams of one segment each, at least one.

    Raises
    ------
    InvalidInputError
        If there is no stream, one has several segments, or their frames per second differ.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If one is not a complete stream that this build reads.
    """
    if not streams:
        raise InvalidInputError("there are no streams to join; give at least one")
    first, *further = map(whole_stream, streams)
    rates = {first.fps, *(one.fps for one in further)}
    if len(rates) > 1:
        raise InvalidInputError(
            f"streams of {' and '.join(f'{rate:g}' for rate in sorted(rates))} frames per second "
            "cannot be joined; encode them with the same fps="
        )
    file, n_frames = BytesIO(), sum(one.n_frames for one in (first, *further))
    writer = StreamWriter(file, replace(header_of(first), n_frames=n_frames), leading_of(first))
    _write_blocks(writer, first)
    for one in further:
        sections = (stored for stored in leading_of(one) if stored[0] is not Section.START)
        writer.begin_segment(header_of(one), sections)
        _write_blocks(writer, one)
    writer.finish()
    return file.getvalue()


def separate_stream(opened: OpenStream) -> bytes:
    """Return a stream of one segment, with its start time, without re-encoding.

    Raises
    ------
    CorruptStreamError
        If a section is damaged.
    """
    leading = list(leading_of(opened))
    if opened.start_s and Section.START not in dict(leading):
        leading.append((Section.START, struct.pack("<d", opened.start_s)))
    return written_stream(header_of(opened), leading, blocks_of(opened))


def _write_blocks(writer: StreamWriter, opened: OpenStream) -> None:
    for n_frames, sections in blocks_of(opened):
        writer.write_block(n_frames, sections)


def header_of(opened: OpenStream) -> Header:
    """Return the header of a stream of one segment."""
    info = opened.file.info
    return Header(
        n_frames=info.n_frames,
        n_verts=info.n_verts,
        n_faces=info.n_triangles,
        fps=info.fps,
        vertex_type=VertexType(info.number_bytes),
        method=info.method,
        laplacian=info.laplacian,
        order=info.order,
        origin=info.center,
        scale=info.diagonal,
        name=info.name,
    )


def leading_of(opened: OpenStream) -> Iterator[tuple[Section, bytes]]:
    """Return the known sections before the first block that any segment may have."""
    leading = (one for one in opened.leading if one.id != Section.SEGMENT)
    return ((Section(one.id), opened.payload(one)) for one in leading)


def blocks_of(opened: OpenStream) -> Iterator[tuple[int, list[tuple[Section, bytes]]]]:
    """Yield the number of frames and the sections of each block."""
    for number in range(opened.n_blocks):
        groups = (opened.group(number, track) for track in range(opened.file.info.n_tracks))
        sections = [one for group in groups for one in group]
        yield opened.file.block(number).n_frames, sections
