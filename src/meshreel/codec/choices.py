"""Enumerated choices of encoding; the integers are codes in the stream."""

from enum import Enum, IntEnum


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


class Tune(Enum):
    """Error measure that the encoder optimizes."""

    VISUAL = "visual"
    GEOMETRY = "geometry"


class Allocation(Enum):
    """Distribution of bits over the rows of coefficients."""

    ENERGY = "energy"
    CONSTANT = "constant"
