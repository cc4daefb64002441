"""Blocks of frames as they are stored in a stream."""

from dataclasses import dataclass

from meshreel.bitstream.layout import MAX_NUMBERS_PER_BYTE, Section
from meshreel.bitstream.reader import Stream
from meshreel.codec.methods import Method
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError


@dataclass(frozen=True)
class StoredBlock:
    """A block as it is stored in a stream, with the number of its first frame.

    Attributes
    ----------
    start, n_frames, n_modes : int
    sections : dict of Section to bytes
        Of one track: the positions, if nothing else is said.
    """

    start: int
    n_frames: int
    n_modes: int
    sections: dict[Section, bytes]

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


def stored_blocks(stream: Stream, method: Method) -> list[StoredBlock]:
    """All blocks of a stream; raises as `stored_block`."""
    return [stored_block(stream, method, number) for number in range(len(stream.places))]


def stored_block(stream: Stream, method: Method, number: int) -> StoredBlock:
    """A block of a stream.

    Parameters
    ----------
    stream : Stream
    method : Method
    number : int

    Raises
    ------
    CorruptStreamError
        If it is damaged, has more or fewer modes than its method allows, or not the number of
        frames in the index.
    """
    sections = stream.block(number)
    n_frames, n_modes = read_block(sections[Section.BLOCK])
    if n_frames != stream.places[number].n_frames:
        raise CorruptStreamError(
            f"block {number} has {n_frames} frames; the index has {stream.places[number].n_frames}"
        )
    limit = method.most_modes(n_frames, stream.header.n_verts)
    least = min(1, limit)
    if not least <= n_modes <= limit:
        raise CorruptStreamError(
            f"a block of {n_frames} frames has {n_modes} modes; {least} to {limit} are possible"
        )
    return StoredBlock(stream.starts[number], n_frames, n_modes, sections)


def stored_track_block(
    stream: Stream, number: int, track: int, shape: tuple[int, int], *, is_exact: bool = False
) -> StoredBlock:
    """A further track in a block of a stream.

    Parameters
    ----------
    stream : Stream
    number : int
    track : int
        From 1 on.
    shape : tuple of 2 ints
        Vertices, faces or corners that have values, and columns of the track.
    is_exact : bool, default False
        Whether it has no modes.

    Raises
    ------
    CorruptStreamError
        If it is damaged, or has more modes than columns for each frame, or more numbers than its
        bytes allow.
    """
    place = stream.places[number]
    sections = stream.block(number, track)
    n_modes, position = read_varint(sections[Section.TRACK_BLOCK], 0)
    n_items, n_columns = shape
    limit = n_columns * place.n_frames
    least, most = (0, 0) if is_exact else (1, limit)
    if not least <= n_modes <= most or position != len(sections[Section.TRACK_BLOCK]):
        raise CorruptStreamError(
            f"track {track} has {n_modes} modes in a block of {place.n_frames} frames; {least} to "
            f"{most} are possible"
        )
    n_numbers = limit * n_items
    if n_numbers > MAX_NUMBERS_PER_BYTE * place.sizes[track]:
        raise CorruptStreamError(
            f"track {track} announces {n_numbers} numbers in {place.sizes[track]} bytes; at most "
            f"{MAX_NUMBERS_PER_BYTE} a byte are allowed"
        )
    return StoredBlock(stream.starts[number], place.n_frames, n_modes, sections)


def write_block(n_frames: int, n_modes: int) -> bytes:
    """Payload of the section BLOCK: numbers of frames and modes."""
    return write_varint(n_frames) + write_varint(n_modes)


def read_block(payload: bytes) -> tuple[int, int]:
    """Numbers of frames and modes that `write_block` wrote.

    Raises
    ------
    CorruptStreamError
        If there are no frames, or bytes are left over.
    """
    n_frames, position = read_varint(payload, 0)
    n_modes, position = read_varint(payload, position)
    if not n_frames or position != len(payload):
        raise CorruptStreamError(
            f"a block announces {n_frames} frames, at least 1 is needed, and has "
            f"{len(payload) - position} bytes left over"
        )
    return n_frames, n_modes
