"""The index of a stream: positions of its blocks, for random access."""

from collections.abc import Sequence
from dataclasses import dataclass

from meshreel.entropy.varint import write_varint


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


def write_index(places: Sequence[BlockPlace]) -> bytes:
    """Payload of the section INDEX; blocks are consecutive, and the index follows the last."""
    first = places[0].position if places else 0
    numbers = [first, len(places)]
    for place in places:
        numbers += [place.n_frames, *place.sizes]
    return b"".join(map(write_varint, numbers))
