"""Blocks of frames as they are stored in a stream."""

from dataclasses import dataclass

from meshreel.codec.bitstream.layout import Section
from meshreel.codec.memory import UNLIMITED, MemoryLimit
from meshreel.errors import CorruptStreamError


@dataclass(frozen=True)
class StoredBlock:
    """A block as it is stored in a stream, with the number of its first frame.

    Attributes
    ----------
    sections : dict of Section to bytes
        Of one track: the positions, if nothing else is said.
    limit : MemoryLimit
        Of decoding it.
    """

    start: int
    n_frames: int
    n_modes: int
    sections: dict[Section, bytes]
    limit: MemoryLimit = UNLIMITED

    def payload(self, section: Section) -> bytes:
        """Payload of a section.

        Raises
        ------
        CorruptStreamError
            If the block has none.
        """
        if section not in self.sections:
            raise CorruptStreamError(
                f"the block of frames {self.start}..{self.start + self.n_frames - 1} has no "
                f"section {section.name}"
            )
        return self.sections[section]
