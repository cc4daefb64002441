"""Every constant of the container; `docs/format.md` says what each means."""

from enum import IntEnum
from struct import Struct

MAGIC = b"\x89REEL\r\n\x1a"
"""The high bit catches 7-bit transfers, CR LF catches newline conversion, 1A stops `type`."""

FORMAT_VERSION = 2
OLDEST_VERSION = 1
"""Versions that this build reads: from the oldest to that which it writes."""

OPTIONAL = 0x80
"""Bit of a section id: readers that do not know the section skip it."""


class Section(IntEnum):
    """Ids of the sections."""

    END = 0
    CONNECTIVITY = 1
    ORDER = 2
    ANCHOR_VERTICES = 3
    BLOCK = 16
    BASIS = 17
    ANCHORS = 18
    COEFFICIENTS = 19
    EXACT = 20
    FIELDS = 21
    CORRECTIONS = 22
    PROMISE = OPTIONAL | 1
    PADDING = OPTIONAL | 0
    INDEX = OPTIONAL | 2
    POLYGONS = OPTIONAL | 3
    ATTRIBUTE = OPTIONAL | 4
    GROUPS = OPTIONAL | 5
    PARTS = OPTIONAL | 6
    START = OPTIONAL | 7
    MATERIAL = OPTIONAL | 8
    IMAGE = OPTIONAL | 9


class VertexType(IntEnum):
    """Number type of the positions, by its bytes."""

    FLOAT32 = 4
    FLOAT64 = 8


MAX_POSITIONS_PER_BYTE = 256
"""A stream holds at most this many positions (vertex times frame) and faces a byte.

Readers refuse what claims more before they allocate; writers pad what would be smaller.
"""

INDEX_POSITION = Struct("<Q")
"""Payload of the end marker: the byte at which the index begins (since version 2)."""

MAX_NAME_BYTES = 4096
"""Longest name, in UTF-8."""


def least_size_bytes(n_things: int) -> int:
    """Bytes that hold so many positions or faces at least."""
    return -(-n_things // MAX_POSITIONS_PER_BYTE)
