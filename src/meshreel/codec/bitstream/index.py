"""The index of a stream: positions of its blocks, for random access."""

from collections.abc import Sequence
from dataclasses import dataclass

from meshreel.codec.entropy.varint import write_varint


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


@dataclass(frozen=True)
class SegmentPlace:
    """Position of a segment behind the first, and its blocks.

    Attributes
    ----------
    position : int
        Byte of the stream at which its section SEGMENT begins: the end of the segment before.
    places : sequence of BlockPlace
        At least 1.
    """

    n_verts: int
    n_faces: int
    position: int
    places: Sequence[BlockPlace]


def write_index(places: Sequence[BlockPlace], further: Sequence[SegmentPlace] = ()) -> bytes:
    """Payload of the section INDEX; blocks are consecutive, and the index follows the last.

    Parameters
    ----------
    places : sequence of BlockPlace
        Of the first segment.
    further : sequence of SegmentPlace
        Segments behind it.
    """
    numbers = [places[0].position if places else 0, *_numbers_of(places)]
    for segment in further:
        first = segment.places[0]
        numbers += [segment.n_verts, segment.n_faces, len(first.sizes)]
        numbers += [first.position - segment.position, *_numbers_of(segment.places)]
    return b"".join(map(write_varint, numbers))


def _numbers_of(places: Sequence[BlockPlace]) -> list[int]:
    """How many blocks there are; and of each its frames, and the bytes of each track."""
    return [len(places), *(number for one in places for number in (one.n_frames, *one.sizes))]
