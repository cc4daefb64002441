"""Sections of streams of the paper's methods."""

from dataclasses import dataclass

from meshreel.codec.bitstream.container import read_block_counts
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.open_stream import OpenStream
from meshreel.errors import CorruptStreamError
from meshreel.paper.variants import Basis, variant_named

MODE_BYTES = 48
"""Memory of a value of a mode during decoding: three axes."""


@dataclass(frozen=True)
class StoredBlock:
    """Sections of a block, with the number of its first frame."""

    start: int
    n_frames: int
    n_modes: int
    sections: dict[Section, bytes]

    def payload(self, section: Section) -> bytes:
        """The payload of a section; raises CorruptStreamError if it is missing."""
        if section not in self.sections:
            raise CorruptStreamError(
                f"the block of frames {self.start}..{self.start + self.n_frames - 1} has no "
                f"section {section.name}"
            )
        return self.sections[section]


def stored_block(opened: OpenStream, number: int) -> StoredBlock:
    """Read a block of a stream.

    Raises
    ------
    CorruptStreamError
        If it is damaged, or its number of modes is not allowed.
    MemoryLimitError
        If decoding it would take more than allowed.
    """
    place, listed = opened.file.block(number), list(opened.group(number))
    sections, n_verts = dict(listed), opened.n_verts
    if len(sections) < len(listed):
        raise CorruptStreamError(f"block {number} has a section twice")
    n_frames, n_modes = read_block_counts(sections.get(Section.BLOCK, b""))
    if n_frames != place.n_frames or listed[0][0] is not Section.BLOCK:
        raise CorruptStreamError(
            f"block {number} has {n_frames} frames; the index has {place.n_frames}"
        )
    is_on_graph = variant_named(opened.method.name).basis is Basis.GRAPH
    max_modes = n_verts if is_on_graph else n_frames
    if not 1 <= n_modes <= max_modes:
        raise CorruptStreamError(
            f"a block of {n_frames} frames has {n_modes} modes; 1 to {max_modes} are allowed"
        )
    needed = MODE_BYTES * n_modes * (n_verts + 3 * n_frames)
    needed += 3 * n_frames * n_verts * opened.dtype.itemsize
    what = f"block {number} of {n_frames} frames, {n_verts} vertices and {n_modes} modes"
    opened.limit.require(needed, what)
    return StoredBlock(place.first_frame, n_frames, n_modes, sections)


def only_section(opened: OpenStream, section: Section) -> bytes:
    """The only section of this id before the first block.

    Raises
    ------
    CorruptStreamError
        If there is none, or more than one.
    """
    payloads = [opened.payload(row) for row in opened.leading if row.id == section]
    if len(payloads) != 1:
        raise CorruptStreamError(
            f"the stream has {len(payloads)} sections {section.name}; exactly 1 is allowed"
        )
    return payloads[0]
