"""Positions as decimal text and back, so that float32 comes back as the same float32."""

import math

import numpy as np

from meshreel.formats.ragged import Integers
from meshreel.sequence import Vertices

FLOAT32_TOLERANCE = 1e-6  # of the model's size; float32 itself keeps 6e-8 of the coordinate
# Nine digits are off by up to 5e-9 of the coordinate: half the tolerance at this distance.
NEAR_DIAGONALS = 100
BLOCK_ROWS = 1 << 16  # rows turned into Python objects at a time


def vertex_rows(vertices: Vertices, *, prefix: str = "") -> bytes:
    """One line ``x y z`` for each vertex, with as many digits as it takes to read it back exactly.

    Nine digits tell all float32 apart. Float64 gets the shortest text that is exact, and so does
    float32 far from the origin, where `narrow_if_harmless` must see that it is float32.

    Parameters
    ----------
    vertices : float32 or float64 array of shape (V, 3)
        Positions in model units, finite.
    prefix : str, default ""
        What every line begins with.
    """
    with np.errstate(over="ignore"):
        is_near = np.abs(vertices).max() <= NEAR_DIAGONALS * _diagonal(vertices)
    number = "%.9g" if vertices.dtype == np.float32 and is_near else "%r"
    return _rows(f"{prefix}{number} {number} {number}\n", vertices)


def narrow_if_harmless(vertices: Vertices) -> Vertices:
    """The positions as float32, unless that would move one by more than a millionth of the model.

    Decimal text does not say its precision. Float32 is what nearly all files were made from;
    only a model far from the origin, in relation to its size, needs float64.

    Parameters
    ----------
    vertices : float32 or float64 array of shape (T, V, 3)
        Positions in model units.

    Returns
    -------
    float32 array, or `vertices` itself if a coordinate would change by more than 1e-6 of the
    model's size, which is the largest diagonal of the bounding box of a frame.
    """
    if vertices.dtype == np.float32:
        return vertices
    with np.errstate(over="ignore", invalid="ignore"):
        narrow = vertices.astype(np.float32)
        size = max(_diagonal(frame) for frame in vertices)
        pairs = zip(vertices, narrow, strict=True)
        change = max(float(np.abs(wide - near).max()) for wide, near in pairs)
    return vertices if change > FLOAT32_TOLERANCE * size else narrow


def face_rows(faces: Integers, *, prefix: str = "") -> bytes:
    """One line ``a b c`` for each triangle, after `prefix`."""
    return _rows(f"{prefix}%d %d %d\n", faces)


def _rows(line: str, rows: Vertices | Integers) -> bytes:
    blocks = (rows[begin : begin + BLOCK_ROWS] for begin in range(0, len(rows), BLOCK_ROWS))
    return b"".join((line * len(b) % tuple(b.ravel().tolist())).encode("ascii") for b in blocks)


def _diagonal(frame: Vertices) -> float:
    """Diagonal of the bounding box of positions of shape (V, 3)."""
    sides = np.subtract(frame.max(axis=0), frame.min(axis=0), dtype=np.float64)
    return math.hypot(*sides.tolist())
