"""Join streams into a stream of several segments, and separate them again."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from meshreel.codec.bitstream.container import Header, write_stream
from meshreel.codec.bitstream.layout import Section, VertexType
from meshreel.codec.open_stream import OpenStream, whole_stream
from meshreel.codec.times import TIMING_SECTIONS, timing_sections
from meshreel.errors import InvalidInputError
from meshreel.model.timing import Timing


def join_streams(
    streams: Sequence[bytes], *, name: str | None = None, timing: Timing | None = None
) -> bytes:
    """Join streams into one whose segments are their meshes, without re-encoding.

    Parameters
    ----------
    streams : sequence of bytes
        Complete streams of one segment each, at least one.
    name : str, optional
        Name of the sequence. Default: that of the first stream.
    timing : Timing, optional
        Default: `Timing.joined` of all streams.

    Raises
    ------
    InvalidInputError
        If there is no stream, one has several segments, or their times do not fit.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If one is not a complete stream that this build reads.
    """
    if not streams:
        raise InvalidInputError("there are no streams to join; give at least one")
    opened = [whole_stream(stream) for stream in streams]
    counts = [stream.n_frames for stream in opened]
    if timing is None:
        timing = Timing.joined([stream.timing for stream in opened], counts)
    first, *further = opened
    header = replace(
        header_of(first),
        n_frames=sum(counts),
        fps=timing.fps,
        name=first.name if name is None else name,
    )
    leading = list(leading_of(first))
    if timing != first.timing:
        leading = [*_without_timing(first), *timing_sections(timing)]
    others = ((header_of(stream), _without_timing(stream), blocks_of(stream)) for stream in further)
    return write_stream((header, leading, blocks_of(first)), *others)


def separate_stream(opened: OpenStream) -> bytes:
    """Return a stream of one segment, with its times, without re-encoding."""
    leading = [*_without_timing(opened), *timing_sections(opened.timing)]
    return write_stream((header_of(opened), leading, blocks_of(opened)))


def _without_timing(opened: OpenStream) -> list[tuple[Section, bytes]]:
    return [section for section in leading_of(opened) if section[0] not in TIMING_SECTIONS]


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
    """Yield the known sections before the first block, except SEGMENT and REFERENCE."""
    return ((Section(section.id), opened.payload(section)) for section in opened.file.leading)


def blocks_of(opened: OpenStream) -> Iterator[tuple[int, list[tuple[Section, bytes]]]]:
    """Yield the number of frames and the sections of each block."""
    for number in range(opened.n_blocks):
        groups = (opened.group(number, track) for track in range(opened.file.info.n_tracks))
        sections = [part for group in groups for part in group]
        yield opened.file.block(number).n_frames, sections
