"""A block of frames as stored in a stream."""

from dataclasses import dataclass

from meshreel.codec.bitstream.layout import Section
from meshreel.codec.memory import UNLIMITED, MemoryLimit
from meshreel.errors import CorruptStreamError


@dataclass(frozen=True)
class StoredBlock:
    """Sections of one track in a block, with the number of its first frame."""

    start: int
    n_frames: int
    n_modes: int
    sections: dict[Section, bytes]
    limit: MemoryLimit = UNLIMITED

    def payload(self, section: Section) -> bytes:
        """Return the payload of a section; raises CorruptStreamError if it is missing."""
        if section not in self.sections:
            raise CorruptStreamError(
                f"the block of frames {self.start}..{self.start + self.n_frames - 1} has no "
                f"section {section.name}"
            )
        return self.sections[section]
