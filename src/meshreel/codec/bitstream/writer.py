"""Writer of streams, part by part: bytes that are written never change."""

from collections.abc import Iterable
from io import BytesIO
from typing import BinaryIO

from meshreel.codec.bitstream.header import Header, write_header, write_segment
from meshreel.codec.bitstream.index import BlockPlace, SegmentPlace, write_index
from meshreel.codec.bitstream.layout import INDEX_POSITION, Section
from meshreel.codec.bitstream.sections import write_sections

Sections = Iterable[tuple[Section, bytes]]


class StreamWriter:
    """Writes a stream to a file: header and leading sections first, then one block after another.

    The file is readable up to the last block written, even if the writer is interrupted.

    Parameters
    ----------
    file : binary file, open for writing
        Written from its beginning on; it need not be able to seek.
    header : Header
        Its number of frames is 0 if it is not known yet.
    leading : iterable of (Section, bytes)
        The sections before the first block.
    """

    def __init__(self, file: BinaryIO, header: Header, leading: Sections) -> None:
        self._file = file
        self._header = header
        self._first: list[BlockPlace] = []
        self._further: list[SegmentPlace] = []
        self._places = self._first  # of the segment that is being written
        self._position = 0
        self._write(write_header(header) + b"".join(write_sections(list(leading))))

    @property
    def size_bytes(self) -> int:
        """Bytes written so far."""
        return self._position

    def begin_segment(self, header: Header, leading: Sections) -> None:
        """Begin another mesh, whose frames follow those of the blocks written so far.

        Parameters
        ----------
        header : Header
            Its name, frames and frames per second are not stored: those of the stream apply.
        leading : iterable of (Section, bytes)
            The sections before its first block; no START.
        """
        assert self._places, "a segment has at least one block"
        self._places = []
        counts = header.n_verts, header.n_faces
        self._further.append(SegmentPlace(*counts, self._position, self._places))
        first = Section.SEGMENT, write_segment(header, self._header)
        self._write(b"".join(write_sections([first, *leading])))

    def write_block(self, n_frames: int, sections: Sections) -> None:
        """Write a block; the file is flushed.

        Parameters
        ----------
        sections : iterable of (Section, bytes)
            BLOCK first and COEFFICIENTS last: a block whose last section is complete is complete.
            Each TRACK_BLOCK begins the sections of a further track.
        """
        found = list(sections)
        written, start, sizes = write_sections(found), self._position, [0]
        for (section, _), data in zip(found, written, strict=True):
            if section is Section.TRACK_BLOCK:
                sizes.append(0)
            sizes[-1] += len(data)
        self._write(b"".join(written))
        self._file.flush()
        self._places.append(BlockPlace(n_frames, start, tuple(sizes)))

    def finish(self) -> None:
        """Write the index and the end marker; nothing may follow."""
        index = write_index(self._first, self._further)
        position = INDEX_POSITION.pack(self._position)
        self._write(b"".join(write_sections([(Section.INDEX, index), (Section.END, position)])))
        self._file.flush()

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self._position += len(data)


def whole_stream(
    header: Header, leading: Sections, blocks: Iterable[tuple[int, Sections]]
) -> bytes:
    """The bytes of a stream.

    Parameters
    ----------
    leading : iterable of (Section, bytes)
    blocks : iterable of (int, iterable of (Section, bytes))
        Number of frames and sections of each.
    """
    file = BytesIO()
    writer = StreamWriter(file, header, leading)
    for block in blocks:
        writer.write_block(*block)
    writer.finish()
    return file.getvalue()
