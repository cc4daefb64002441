"""The index of a stream: positions of its blocks, for random access."""

from collections.abc import Sequence
from dataclasses import dataclass

from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError


@dataclass(frozen=True)
class BlockPlace:
    """Position and size of a block of frames in a stream.

    Attributes
    ----------
    n_frames : int
        At least 1.
    position : int
        Byte of the stream at which its first section begins.
    sizes : tuple of int
        Bytes of the sections of each track, the positions first; at least 1 each.
    """

    n_frames: int
    position: int
    sizes: tuple[int, ...]

    @property
    def size_bytes(self) -> int:
        """Of all its sections."""
        return sum(self.sizes)

    def group(self, track: int) -> tuple[int, int]:
        """First byte of the sections of a track, and the byte after the last."""
        start = self.position + sum(self.sizes[:track])
        return start, start + self.sizes[track]

    @property
    def end(self) -> int:
        """Byte after its last section."""
        return self.position + self.size_bytes


def write_index(places: Sequence[BlockPlace]) -> bytes:
    """Payload of the section INDEX; blocks are consecutive, and the index follows the last."""
    first = places[0].position if places else 0
    numbers = [first, len(places)]
    for place in places:
        numbers += [place.n_frames, *place.sizes]
    return b"".join(map(write_varint, numbers))


def first_block(payload: bytes) -> int:
    """Byte of the stream at which the first block begins, from the payload of INDEX."""
    return read_varint(payload, 0)[0]


def read_index(payload: bytes, end: int, n_tracks: int) -> list[BlockPlace]:
    """Positions of the blocks, which `write_index` wrote.

    Parameters
    ----------
    payload : bytes
    end : int
        Byte of the stream at which the section INDEX begins.
    n_tracks : int
        Tracks of each block, the positions among them.

    Raises
    ------
    CorruptStreamError
        If blocks or tracks are empty, or do not end where the index begins.
    """
    start, position = read_varint(payload, 0)
    n_blocks, position = read_varint(payload, position)
    places = []
    for _ in range(min(n_blocks, len(payload))):
        n_frames, position = read_varint(payload, position)
        sizes = []
        for _ in range(n_tracks):
            size_bytes, position = read_varint(payload, position)
            sizes.append(size_bytes)
        places.append(BlockPlace(n_frames, start, tuple(sizes)))
        start = places[-1].end
    is_whole = len(places) == n_blocks and position == len(payload)
    if not is_whole or start != end or not all(one.n_frames and all(one.sizes) for one in places):
        raise CorruptStreamError(
            f"the index lists {n_blocks} blocks up to byte {start}; they should end at byte {end}"
        )
    return places
