"""Join streams into a stream of several segments, and separate them again."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from meshreel.codec.bitstream.container import Header, write_stream
from meshreel.codec.bitstream.layout import Section, VertexType
from meshreel.codec.open_stream import OpenStream, whole_stream
from meshreel.codec.surface.payloads import write_start
from meshreel.errors import InvalidInputError, Keyword


def join_streams(
    streams: Sequence[bytes], *, name: str | None = None, start_s: float | None = None
) -> bytes:
    """Join streams into one whose segments are their meshes, without re-encoding.

    Parameters
    ----------
    streams : sequence of bytes
        Complete streams of one segment each, at least one.
    name : str, optional
        Name of the sequence. Default: that of the first stream.
    start_s : float, optional
        Time of the first frame in seconds. Default: that of the first stream.

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
    rates = {first.fps, *(stream.fps for stream in further)}
    if len(rates) > 1:
        raise InvalidInputError(
            f"streams of {' and '.join(f'{rate:g}' for rate in sorted(rates))} frames per second "
            "cannot be joined; encode them with the same ",
            Keyword("fps"),
        )
    header = replace(
        header_of(first),
        n_frames=sum(stream.n_frames for stream in (first, *further)),
        name=first.name if name is None else name,
    )
    leading = list(leading_of(first))
    if start_s is not None and start_s != first.start_s:
        leading = _without_start(first)
        if start_s:
            leading.append((Section.START, write_start(start_s)))
    others = ((header_of(stream), _without_start(stream), blocks_of(stream)) for stream in further)
    return write_stream((header, leading, blocks_of(first)), *others)


def separate_stream(opened: OpenStream) -> bytes:
    """Return a stream of one segment, with its start time, without re-encoding.

    Raises
    ------
    CorruptStreamError
        If a section is damaged.
    """
    leading = list(leading_of(opened))
    if opened.start_s and Section.START not in dict(leading):
        leading.append((Section.START, write_start(opened.start_s)))
    return write_stream((header_of(opened), leading, blocks_of(opened)))


def _without_start(opened: OpenStream) -> list[tuple[Section, bytes]]:
    return [stored for stored in leading_of(opened) if stored[0] is not Section.START]


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
    return ((Section(section.id), opened.payload(section)) for section in opened.leading)


def blocks_of(opened: OpenStream) -> Iterator[tuple[int, list[tuple[Section, bytes]]]]:
    """Yield the number of frames and the sections of each block."""
    for number in range(opened.n_blocks):
        groups = (opened.group(number, track) for track in range(opened.file.info.n_tracks))
        sections = [part for group in groups for part in group]
        yield opened.file.block(number).n_frames, sections
