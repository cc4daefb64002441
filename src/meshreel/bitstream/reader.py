"""The parts of a stream, each checked before anything of it is believed."""

from dataclasses import dataclass

from meshreel.bitstream.header import Header, read_header
from meshreel.bitstream.layout import MAX_POSITIONS_PER_BYTE, Section
from meshreel.bitstream.sections import StoredSection, read_section
from meshreel.bitstream.writer import least_size_bytes
from meshreel.errors import CorruptStreamError


@dataclass(frozen=True)
class Stream:
    """A stream taken apart.

    Attributes
    ----------
    header : Header
    header_size_bytes : int
    sections : tuple of StoredSection
        In the order of the stream, without unknown optional ones; the end marker is the last.
    size_bytes : int
    """

    header: Header
    header_size_bytes: int
    sections: tuple[StoredSection, ...]
    size_bytes: int

    def only(self, section: Section) -> bytes:
        """Payload of the one section of this id.

        Raises
        ------
        CorruptStreamError
            If there is none, or more than one.
        """
        found = [stored.payload for stored in self.sections if stored.id is section]
        if len(found) != 1:
            raise CorruptStreamError(
                f"the stream has {len(found)} sections {section.name}; exactly 1 is allowed"
            )
        return found[0]

    def blocks(self) -> list[dict[Section, bytes]]:
        """Sections of each block of frames, by id.

        Raises
        ------
        CorruptStreamError
            If a block has the same section twice, or a block's section comes before any block.
        """
        blocks: list[dict[Section, bytes]] = []
        for stored in self.sections:
            if stored.id is Section.BLOCK:
                blocks.append({})
            if Section.BLOCK <= stored.id < Section.PADDING:
                if not blocks or stored.id in blocks[-1]:
                    raise CorruptStreamError(f"section {stored.id.name} is out of place")
                blocks[-1][stored.id] = stored.payload
        return blocks


def read_stream(data: bytes) -> Stream:
    """The header and all sections of a stream, their checksums verified.

    Raises
    ------
    CorruptStreamError
        If anything contradicts itself, or bytes follow the end marker.
    TruncatedStreamError
        If the data end before the end marker.
    UnsupportedVersionError
        If a newer build is needed.
    """
    header, header_size = read_header(data)
    position = header_size
    sections: list[StoredSection] = []
    while not sections or sections[-1].id is not Section.END:
        stored, position = read_section(data, position)
        if stored is not None:
            sections.append(stored)
    if position != len(data):
        raise CorruptStreamError(f"{len(data) - position} bytes follow the end marker")
    if least_size_bytes(header) > len(data):
        raise CorruptStreamError(
            f"the header announces {header.n_frames} frames of {header.n_verts} vertices and "
            f"{header.n_faces} faces; a stream of {len(data)} bytes holds at most "
            f"{MAX_POSITIONS_PER_BYTE} positions or faces a byte"
        )
    return Stream(header, header_size, tuple(sections), len(data))
