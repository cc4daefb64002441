"""Constants of the container; see `docs/format.md`."""

from enum import IntEnum
from struct import Struct

MAGIC = b"\x89REEL\r\n\x1a"
"""The high bit catches 7-bit transfers, CR LF catches newline conversion, 1A stops `type`."""

FORMAT_VERSION = 3
"""Version that this build writes and reads; 1 and 2 preceded the first release."""

OPTIONAL = 0x80
"""Bit of a section id: readers that do not know the section skip it."""


class Section(IntEnum):
    """Ids of the sections."""

    END = 0
    CONNECTIVITY = 1
    ORDER = 2
    ANCHOR_VERTICES = 3
    SHAPE = 4
    SEGMENT = 5
    REFERENCE = 6
    EDIT = 7
    CELLS = 8
    BLOCK = 16
    BASIS = 17
    ANCHORS = 18
    COEFFICIENTS = 19
    EXACT = 20
    FIELDS = 21
    CORRECTIONS = 22
    TRACK_BLOCK = 23
    VALUES = 24
    MISSING = 25
    ANCHOR_RESIDUALS = 26
    ROUNDING = 27
    ERROR_BOUND = OPTIONAL | 1
    INDEX = OPTIONAL | 2
    POLYGONS = OPTIONAL | 3
    ATTRIBUTE = OPTIONAL | 4
    GROUPS = OPTIONAL | 5
    PARTS = OPTIONAL | 6
    START = OPTIONAL | 7
    MATERIAL = OPTIONAL | 8
    IMAGE = OPTIONAL | 9
    TRACK = OPTIONAL | 10
    HARD_EDGES = OPTIONAL | 11
    TIMES = OPTIONAL | 12
    ATTRIBUTE_FROM_POINTS = OPTIONAL | 13


SURFACE_SECTIONS = (
    Section.POLYGONS,
    Section.ATTRIBUTE,
    Section.ATTRIBUTE_FROM_POINTS,
    Section.GROUPS,
    Section.PARTS,
    Section.MATERIAL,
    Section.IMAGE,
    Section.HARD_EDGES,
)

MESH_SECTIONS = (
    Section.CONNECTIVITY,
    Section.ORDER,
    Section.EDIT,
    Section.CELLS,
    *SURFACE_SECTIONS,
)
"""Sections of a mesh. A segment may share them with an earlier one, except those that depend on
its positions."""

APPEARANCE_SECTIONS = (Section.MATERIAL, Section.IMAGE)
"""Surface sections that do not depend on the mesh; writers store them last."""


class Laplacian(IntEnum):
    """Laplacian matrix of the delta coordinates."""

    NORMALIZED = 0
    COMBINATORIAL = 1
    COTANGENT = 2


class Order(IntEnum):
    """Which part of the given order of vertices and faces to keep."""

    KEEP = 0
    VERTICES = 1
    DROP = 2


class VertexType(IntEnum):
    """Number type of the positions, by its size in bytes."""

    FLOAT32 = 4
    FLOAT64 = 8


INDEX_POSITION = Struct("<Q")
"""Payload of the end marker: the byte at which the index begins."""

MAX_NAME_BYTES = 4096
"""Longest name, in UTF-8."""
