"""Choices that a stream is made with; those that it states have codes in it."""

from enum import Enum, IntEnum


class Laplacian(IntEnum):
    """Which matrix the delta coordinates are made with."""

    NORMALIZED = 0
    COMBINATORIAL = 1
    COTANGENT = 2


class Order(IntEnum):
    """The part of the given order of vertices and faces that is kept."""

    KEEP = 0
    VERTICES = 1
    DROP = 2


class Tune(Enum):
    """The error that bits are spent against."""

    VISUAL = "visual"
    GEOMETRY = "geometry"


class Allocation(Enum):
    """The allocation of a single number of bits to the rows of coefficients."""

    ENERGY = "energy"
    CONSTANT = "constant"
