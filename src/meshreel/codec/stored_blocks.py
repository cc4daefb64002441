"""Blocks of frames as they are stored in a stream."""

from dataclasses import dataclass

from meshreel.bitstream.layout import Section
from meshreel.bitstream.reader import Stream
from meshreel.codec.memory import DEFAULT_LIMIT, UNLIMITED, MemoryLimit
from meshreel.codec.methods import Method
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError

FIELD_BYTES = 16
"""Of each decoded value of a mode, at a vertex or over time: as it is, and packed for products."""


@dataclass(frozen=True)
class StoredBlock:
    """A block as it is stored in a stream, with the number of its first frame.

    Attributes
    ----------
    start, n_frames, n_modes : int
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


def stored_blocks(
    stream: Stream, method: Method, limit: MemoryLimit = DEFAULT_LIMIT
) -> list[StoredBlock]:
    """All blocks of a stream; raises as `stored_block`."""
    return [stored_block(stream, method, number, limit) for number in range(len(stream.places))]


def stored_block(
    stream: Stream, method: Method, number: int, limit: MemoryLimit = DEFAULT_LIMIT
) -> StoredBlock:
    """A block of a stream.

    Parameters
    ----------
    stream : Stream
    method : Method
    number : int
    limit : MemoryLimit, optional
        Of decoding it.

    Raises
    ------
    CorruptStreamError
        If it is damaged, has more or fewer modes than its method allows, or not the number of
        frames in the index.
    MemoryLimitError
        If decoding it would take more than allowed.
    """
    sections = stream.block(number)
    n_frames, n_modes = read_block(sections[Section.BLOCK])
    if n_frames != stream.places[number].n_frames:
        raise CorruptStreamError(
            f"block {number} has {n_frames} frames; the index has {stream.places[number].n_frames}"
        )
    most = method.most_modes(n_frames, stream.header.n_verts)
    least = min(1, most)
    if not least <= n_modes <= most:
        raise CorruptStreamError(
            f"a block of {n_frames} frames has {n_modes} modes; {least} to {most} are possible"
        )
    n_verts, number_bytes = stream.header.n_verts, int(stream.header.vertex_type)
    needed = 0 if n_modes else 3 * n_frames * n_verts * number_bytes
    needed += FIELD_BYTES * n_modes * (n_verts + 3 * n_frames)
    if not method.has_tracks:  # the paper's methods have modes for each axis, and exact positions
        needed *= 3
        needed += 3 * n_frames * n_verts * number_bytes
    what = f"block {number} of {n_frames} frames, {n_verts} vertices and {n_modes} modes"
    limit.require(needed, what)
    return StoredBlock(stream.starts[number], n_frames, n_modes, sections, limit)


def stored_track_block(
    stream: Stream,
    number: int,
    track: int,
    shape: tuple[int, int],
    number_bytes: int,
    limit: MemoryLimit = DEFAULT_LIMIT,
    *,
    is_exact: bool = False,
) -> StoredBlock:
    """A further track in a block of a stream.

    Parameters
    ----------
    stream : Stream
    number : int
    track : int
        From 1 on.
    shape : tuple of 2 ints
        Vertices, faces or corners that have values, and columns that are coded.
    number_bytes : int
        Size of a number of the track.
    limit : MemoryLimit, optional
        Of decoding it.
    is_exact : bool, default False
        Whether it has no modes.

    Raises
    ------
    CorruptStreamError
        If it is damaged, or has more modes than columns for each frame.
    MemoryLimitError
        If decoding it would take more than allowed.
    """
    place = stream.places[number]
    sections = stream.block(number, track)
    n_modes, position = read_varint(sections[Section.TRACK_BLOCK], 0)
    n_items, n_columns = shape
    n_per_item = n_columns * place.n_frames
    least, most = (0, 0) if is_exact else (1, n_per_item)
    if not least <= n_modes <= most or position != len(sections[Section.TRACK_BLOCK]):
        raise CorruptStreamError(
            f"track {track} has {n_modes} modes in a block of {place.n_frames} frames; {least} to "
            f"{most} are possible"
        )
    needed = n_per_item * n_items * number_bytes + FIELD_BYTES * n_modes * (n_items + n_per_item)
    limit.require(
        needed,
        f"block {number} of track {track}, {place.n_frames} x {n_items} x {n_columns} numbers,",
    )
    return StoredBlock(stream.starts[number], place.n_frames, n_modes, sections, limit)


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
