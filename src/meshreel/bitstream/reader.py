"""Reader of the parts of a stream, each checked before it is used."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from itertools import accumulate
from typing import BinaryIO

from meshreel.bitstream.header import LONGEST_HEADER, Header, read_header
from meshreel.bitstream.index import BlockPlace, first_block, read_index
from meshreel.bitstream.layout import INDEX_POSITION, OPTIONAL, Section
from meshreel.bitstream.sections import (
    END_SIZE_BYTES,
    SectionHead,
    StoredSection,
    read_head,
    read_section,
)
from meshreel.counting import counted
from meshreel.entropy.varint import read_varint
from meshreel.errors import CorruptStreamError, MeshReelError, TruncatedStreamError
from meshreel.stores.ranged_file import RangedFile

BLOCK_SECTIONS = range(Section.BLOCK, OPTIONAL)
"""Ids of sections that belong to a block."""


LAST_OF_A_GROUP = (Section.COEFFICIENTS, Section.VALUES)
"""A group is complete when it has one of these."""


@dataclass(frozen=True)
class Stream:
    """A parsed stream; its blocks are read on demand.

    Attributes
    ----------
    file : binary file that can seek
    size_bytes : int
    header : Header
    header_size_bytes : int
    leading : tuple of StoredSection
        Sections before the first block, without unknown optional ones.
    places : tuple of BlockPlace
        Positions of all complete blocks.
    is_whole : bool
        Whether it has its end marker; else writing was interrupted, or the end was lost.
    """

    file: BinaryIO
    size_bytes: int
    header: Header
    header_size_bytes: int
    leading: tuple[StoredSection, ...]
    places: tuple[BlockPlace, ...]
    is_whole: bool

    def __post_init__(self) -> None:
        if not self.places:
            raise CorruptStreamError("the stream holds no block of frames")
        announced = self.header.n_frames
        if announced and self.is_whole and self.n_frames != announced:
            raise CorruptStreamError(
                f"the blocks hold {counted(self.n_frames, 'frame')}; the header announces "
                f"{announced}"
            )

    @cached_property
    def starts(self) -> list[int]:
        """First frame of each complete block, and the number of all frames."""
        return list(accumulate((place.n_frames for place in self.places), initial=0))

    @property
    def n_frames(self) -> int:
        """Number of frames of all complete blocks."""
        return self.starts[-1]

    def only(self, section: Section) -> bytes:
        """Payload of the only section of this id before the first block.

        Raises
        ------
        CorruptStreamError
            If there is none, or more than one.
        """
        found = [stored.payload for stored in self.leading if stored.id is section]
        if len(found) != 1:
            raise CorruptStreamError(
                f"the stream has {len(found)} sections {section.name}; exactly 1 is allowed"
            )
        return found[0]

    def block(self, number: int, track: int = 0) -> dict[Section, bytes]:
        """Sections of a track in a block, by id; checksums are verified.

        Raises
        ------
        CorruptStreamError
            If its bytes are damaged, a section occurs twice or does not belong to a block, or
            there is none that this build knows.
        """
        first = Section.TRACK_BLOCK if track else Section.BLOCK
        sections: dict[Section, bytes] = {}
        for stored in _sections(self.file, *self.places[number].group(track)):
            if (stored.id is first) != (not sections):
                raise CorruptStreamError(
                    f"block {number} does not begin with a section {first.name}"
                    + (f" of track {track}" if track else "")
                )
            if stored.id in BLOCK_SECTIONS:
                if stored.id in sections:
                    raise CorruptStreamError(f"section {stored.id.name} is out of place")
                sections[stored.id] = stored.payload
        if not sections:  # all are optional ones that this build does not know
            raise CorruptStreamError(f"block {number} has no section {first.name}")
        return sections

    @property
    def is_remote(self) -> bool:
        """Whether its bytes are fetched from elsewhere as they are needed."""
        return isinstance(self.file, RangedFile)

    def heads(self) -> Iterator[SectionHead]:
        """Heads of all sections in order, the end marker included; no checksum is verified."""
        position = self.header_size_bytes
        end = self.size_bytes if self.is_whole else self.places[-1].end
        while position < end:
            head = read_head(self.file, position, end)
            yield head
            position += head.size_bytes

    def payload(self, head: SectionHead) -> bytes:
        """The payload of a section, whose checksum is not verified."""
        self.file.seek(head.payload_start)
        return self.file.read(head.payload_bytes)

    def sections(self) -> Iterator[StoredSection]:
        """All sections in order, the end marker included, without unknown optional ones."""
        end = self.size_bytes if self.is_whole else self.places[-1].end
        return _sections(self.file, self.header_size_bytes, end)


def read_stream(data: bytes) -> Stream:
    """A whole stream, every byte of it checked.

    Raises
    ------
    CorruptStreamError
        If anything contradicts itself, or bytes follow the end marker.
    TruncatedStreamError
        If the data end before the end marker.
    UnsupportedVersionError
        If a newer build is needed.
    """
    header, header_size_bytes = read_header(data)
    file = BytesIO(data)
    scan = _scan(file, header_size_bytes, len(data))
    if scan.damage:
        raise scan.damage
    if scan.end != len(data):
        raise CorruptStreamError(f"{len(data) - scan.end} bytes follow the end marker")
    _check_index(scan)
    return scan.stream(file, len(data), header, header_size_bytes)


def open_stream(file: BinaryIO) -> Stream:
    """A stream in a file, of which only the index and the sections before the blocks are read.

    Where the index is missing or damaged, blocks are found by reading the file once; whatever
    follows the last complete block is then ignored.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If the header is damaged, or no block is complete.
    UnsupportedVersionError
        If a newer build is needed.
    """
    size_bytes = file.seek(0, os.SEEK_END)
    file.seek(0)
    header, header_size_bytes = read_header(file.read(LONGEST_HEADER))
    try:
        index, position = _found_index(file, header_size_bytes, size_bytes)
        opening = _sections(file, header_size_bytes, first_block(index))
        leading = tuple(opening)
        places = _indexed_places(index, position, header_size_bytes, _n_tracks(leading))
        return Stream(file, size_bytes, header, header_size_bytes, leading, places, True)
    except (CorruptStreamError, TruncatedStreamError):
        scan = _scan(file, header_size_bytes, size_bytes)
    if scan.damage and not scan.places:
        raise scan.damage
    return scan.stream(file, size_bytes, header, header_size_bytes)


def _check_index(scan: "_Scan") -> None:
    """Refuse an index that contradicts the blocks; there may be none.

    Raises
    ------
    CorruptStreamError
        If it does.
    """
    position, payload = scan.index or (0, b"")
    if scan.end_payload != (INDEX_POSITION.pack(position) if scan.index else b""):
        raise CorruptStreamError("the end marker does not point to the index")
    if scan.index and read_index(payload, position, _n_tracks(scan.leading)) != scan.places:
        raise CorruptStreamError("the index contradicts the blocks")


def _n_tracks(leading: Iterable[StoredSection]) -> int:
    """Tracks of each block, by the sections before the first."""
    return 1 + sum(stored.id is Section.TRACK for stored in leading)


def _found_index(file: BinaryIO, start: int, size_bytes: int) -> tuple[bytes, int]:
    """Payload and position of the index, which the end marker points to.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If there is none, or it is damaged.
    """
    end, _ = read_section(file, max(start, size_bytes - END_SIZE_BYTES), size_bytes)
    if end is None or end.id is not Section.END or len(end.payload) != INDEX_POSITION.size:
        raise CorruptStreamError("the stream does not end with an end marker that has an index")
    (position,) = INDEX_POSITION.unpack(end.payload)
    index, _ = read_section(file, position, size_bytes)
    if index is None or index.id is not Section.INDEX:
        raise CorruptStreamError(f"there is no index at byte {position}")
    if not start <= first_block(index.payload) <= position:
        raise CorruptStreamError("the index lists blocks inside the header")
    return index.payload, position


def _indexed_places(
    index: bytes, position: int, start: int, n_tracks: int
) -> tuple[BlockPlace, ...]:
    """Positions of the blocks from the payload of the index at a position.

    Raises
    ------
    CorruptStreamError
        If it is damaged.
    """
    places = read_index(index, position, n_tracks)
    if not places or places[0].position < start:
        raise CorruptStreamError("the index lists no blocks, or blocks inside the header")
    return tuple(places)


def _sections(file: BinaryIO, start: int, end: int) -> Iterator[StoredSection]:
    """Sections between two positions, without unknown ones; of a remote file with one request."""
    if isinstance(file, RangedFile):
        file.fetch(start, end)
    position = start
    while position < end:
        stored, behind = read_section(file, position, end)
        if stored is not None:
            yield stored
        position = behind


@dataclass(frozen=True)
class _Scan:
    """The result of reading a stream section by section.

    Attributes
    ----------
    leading : list of StoredSection
    places : list of BlockPlace
        Positions of the complete blocks.
    end : int
        Byte after the last complete section.
    index : tuple of int and bytes, or None
        Position and payload of the last section INDEX.
    end_payload : bytes
        Of the end marker.
    damage : MeshReelError or None
        The error that ended it before the end marker.
    """

    leading: list[StoredSection]
    places: list[BlockPlace]
    end: int
    index: tuple[int, bytes] | None
    end_payload: bytes
    damage: MeshReelError | None

    def stream(self, file: BinaryIO, size_bytes: int, header: Header, start: int) -> Stream:
        """The stream as far as it is complete."""
        is_whole = self.damage is None
        leading, places = tuple(self.leading), tuple(self.places)
        return Stream(file, size_bytes, header, start, leading, places, is_whole)


def _scan(file: BinaryIO, start: int, size_bytes: int) -> _Scan:
    """The sections up to the end marker, or up to the first damaged one."""
    leading: list[StoredSection] = []
    places: list[BlockPlace] = []
    block: _OpenBlock | None = None
    index: tuple[int, bytes] | None = None
    last, position, end_payload, damage = None, start, b"", None
    n_tracks = 1
    try:
        while last is not Section.END:
            stored, behind = read_section(file, position, size_bytes)
            if stored is not None:
                last = stored.id
                if last in BLOCK_SECTIONS and last is not Section.BLOCK and block is None:
                    raise CorruptStreamError(f"section {last.name} is out of place")
                if last is Section.TRACK_BLOCK and block is not None:
                    block.begins.append(position)
                if last in (Section.BLOCK, Section.INDEX, Section.END):
                    if block is not None:
                        places.append(block.place(position, n_tracks))
                    is_block = last is Section.BLOCK
                    block = _OpenBlock(_n_frames(stored.payload), [position]) if is_block else None
                    if last is Section.INDEX:
                        index = position, stored.payload
                    end_payload = stored.payload
                elif block is None:
                    leading.append(stored)
                    n_tracks += last is Section.TRACK
            position = behind
    except (CorruptStreamError, TruncatedStreamError) as error:
        damage = error
        has_all = block is not None and len(block.begins) == n_tracks
        if block is not None and has_all and last in LAST_OF_A_GROUP:
            places.append(block.place(position, n_tracks))
    return _Scan(leading, places, position, index, end_payload, damage)


@dataclass(frozen=True)
class _OpenBlock:
    """A block whose end has not come yet.

    Attributes
    ----------
    n_frames : int
    begins : list of int
        Where the sections of each track begin.
    """

    n_frames: int
    begins: list[int]

    def place(self, end: int, n_tracks: int) -> BlockPlace:
        """Position and sizes of the block, which ends here; it must have so many tracks."""
        if len(self.begins) != n_tracks:
            raise CorruptStreamError(
                f"the block at byte {self.begins[0]} has {counted(len(self.begins), 'track')}; "
                f"the stream announces {n_tracks}"
            )
        ends = [*self.begins[1:], end]
        sizes = tuple(stop - start for start, stop in zip(self.begins, ends, strict=True))
        return BlockPlace(self.n_frames, self.begins[0], sizes)


def _n_frames(payload: bytes) -> int:
    """Number of frames of a block, which its first section begins with."""
    n_frames, _ = read_varint(payload, 0)
    if not n_frames:
        raise CorruptStreamError("a block announces 0 frames; it must have at least 1")
    return n_frames
