"""Decimal text for numbers that round-trips exactly, detection of float32, and fast parsing.

The parser reads plain decimals such as ``-12.345`` to float64, correctly rounded. Eight characters
are processed as one 64-bit integer: masks remove the decimal point, and three multiplications
combine the digits. The digits as an integer up to 2^53, and a power of ten up to 10^22, are both
exact, so their quotient is rounded only once (Clinger, "How to read floating point numbers
accurately", 1990).
"""

import math
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.model.extent import bounding_boxes
from meshreel.model.sequence import Vertices

FLOAT32_TOLERANCE = 1e-6  # of the model's size; float32 itself keeps 6e-8 of the coordinate
# Nine digits have an error of 5e-9 of the coordinate: half the tolerance at this distance.
NEAR_DIAGONALS = 100
BLOCK_ROWS = 1 << 16  # rows formatted at a time

Eights = npt.NDArray[np.uint64]
Parsed = tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]

MAX_LENGTH = 16
"""Maximum number of characters, without the sign."""

MAX_EXACT = 1 << 53
BLOCK_WORDS = 1 << 12  # words parsed at a time, so that temporaries stay in the cache


def vertex_rows(
    vertices: Vertices, *, prefix: str = "", suffixes: Sequence[str] | None = None
) -> bytes:
    """Return a line ``x y z`` for each vertex, with enough digits to round-trip exactly.

    Nine digits are enough for float32. Float64 gets the shortest exact text, and so does float32
    far from the origin, so that `Narrowing` recognizes it.

    Parameters
    ----------
    vertices : float32 or float64 array of shape (V, 3)
        Positions in model units, finite.
    prefix : str, default ""
        Start of every line.
    suffixes : sequence of V str, optional
        Rest of each line, after a blank; without percent signs.
    """
    if len(vertices) == 0:
        return b""
    with np.errstate(over="ignore"):
        is_near = np.abs(vertices).max() <= NEAR_DIAGONALS * _diagonal(vertices)
    number = "%.9g" if vertices.dtype == np.float32 and is_near else "%r"
    line = f"{prefix}{number} {number} {number}"
    starts = range(0, len(vertices), BLOCK_ROWS)
    blocks = [slice(start, start + BLOCK_ROWS) for start in starts]
    return b"".join(
        _filled(line, vertices[block], None if suffixes is None else suffixes[block])
        for block in blocks
    )


def number_rows(values: npt.NDArray[Any]) -> list[str]:
    """Format each row of values with the fewest digits that round-trip exactly."""
    return [" ".join(map(str, row)) for row in values]


def face_rows(counts: npt.NDArray[np.integer], corners: Iterable[str]) -> list[str]:
    """Join the words of the corners of each face, given the corner counts."""
    words = iter(corners)
    return [" ".join(islice(words, count)) for count in counts.tolist()]


class Narrowing:
    """Decides whether float32 is precise enough for positions read from decimal text.

    Decimal text does not declare its precision. Nearly all files were written from float32; only
    models far from the origin, relative to their size, need float64.
    """

    def __init__(self) -> None:
        self._size = self._change = 0.0

    def add(self, frame: Vertices) -> None:
        """Add a frame: finite positions of shape (V, 3), in model units; V may be 0."""
        if not len(frame):
            return
        with np.errstate(over="ignore"):
            self._size = max(self._size, _diagonal(frame))
            if frame.dtype != np.float32:
                change = np.abs(frame - frame.astype(np.float32)).max()
                self._change = max(self._change, float(change))

    @property
    def is_harmless(self) -> bool:
        """Whether float32 moves no coordinate by more than 1e-6 of the model's size.

        The size is the largest diagonal of the bounding box of a frame.
        """
        return math.isfinite(self._change) and self._change <= FLOAT32_TOLERANCE * self._size


def _filled(line: str, rows: Vertices, suffixes: Sequence[str] | None) -> bytes:
    """Fill the line template with the numbers and suffix of each row."""
    if suffixes is None:
        template = f"{line}\n" * len(rows)
    else:
        template = "".join(f"{line} {suffix}\n" for suffix in suffixes)
    return (template % tuple(rows.ravel().tolist())).encode("ascii")


def _diagonal(frame: Vertices) -> float:
    """Diagonal of the bounding box of positions of shape (V, 3)."""
    (low,), (high,) = bounding_boxes(frame[np.newaxis])
    return math.hypot(*(high - low).tolist())


def _integer(value: int) -> np.uint64:
    return np.uint64(value)


def _each(byte: int) -> np.uint64:
    """A 64-bit integer that repeats a byte eight times."""
    return np.uint64(byte * 0x0101010101010101)


# Constants are created once: creating one takes NumPy as long as processing a hundred words.
_ZEROS, _POINTS = _each(ord("0")), _each(ord(".") ^ ord("0"))
_ONES, _SIXES, _HIGH_BITS, _HIGH_HALVES = _each(0x01), _each(0x06), _each(0x80), _each(0xF0)
_1, _7, _8, _10, _16, _32, _56 = map(_integer, (1, 7, 8, 10, 16, 32, 56))
_QUARTERS = _integer(0x000000FF000000FF)
_EVEN, _ODD, _UPPER = map(_integer, (100 + (1000000 << 32), 1 + (10000 << 32), 10**8))

_BEFORE_END = np.array([[8], [16]])
_LAST = np.array([0, *((1 << 64) - (1 << 8 * (8 - n)) for n in range(1, 9))], np.uint64)
_NO_POINT = 16
_DIVISORS = np.append(10.0 ** np.arange(_NO_POINT), 1.0)


def decimal_values(text: bytes, starts: Integers, ends: Integers) -> Parsed:
    """Return the words of a text as float64, and which were parsed; others are undefined.

    Parameters
    ----------
    starts, ends : int64 arrays of shape (N,)
        Byte range of each word; not empty.

    Returns
    -------
    float64 and bool arrays of shape (N,). Not parsed are words with an exponent, with more than
    `MAX_LENGTH` characters, with digits beyond `MAX_EXACT`, and words that are not numbers.
    """
    padded = b" " * MAX_LENGTH + text
    codes = np.frombuffer(padded, np.uint8)
    eights: Eights = np.ndarray((len(padded) - 7,), "<u8", padded, strides=(1,))
    values, is_parsed = np.empty(len(starts)), np.empty(len(starts), bool)
    for begin in range(0, len(starts), BLOCK_WORDS):
        block = slice(begin, begin + BLOCK_WORDS)
        first, end = starts[block] + MAX_LENGTH, ends[block] + MAX_LENGTH
        sign = codes[first]
        is_negative = sign == ord("-")
        lengths = end - first - (is_negative | (sign == ord("+")))
        found, is_parsed[block] = _unsigned_values(eights, end, lengths)
        values[block] = np.where(is_negative, -found, found)
    return values, is_parsed


def _unsigned_values(eights: Eights, ends: Integers, lengths: Integers) -> Parsed:
    """Parse words without sign, given their ends and lengths; returns as `decimal_values`."""
    # Rows: the last eight characters, and those before; digits as values, missing characters 0.
    counts = np.minimum(lengths - (_BEFORE_END - 8), 8)
    characters = (eights[ends - _BEFORE_END] ^ _ZEROS) & _LAST[np.maximum(counts, 0)]
    points = _points(characters)
    numbers, are_digits = _numbers(_without_points(characters, points))
    number = numbers[1] * _UPPER + numbers[0]
    n_decimals = _n_decimals(points)
    is_parsed = are_digits & (number <= MAX_EXACT)
    is_parsed &= (lengths > (n_decimals < _NO_POINT)) & (lengths <= MAX_LENGTH)
    return number / _DIVISORS[n_decimals], is_parsed


def _points(characters: Eights) -> Eights:
    """Highest bit of the first byte that is a decimal point, in each integer; 0 if none is."""
    differing = characters ^ _POINTS
    # The lowest zero byte is the lowest byte whose highest bit gets set.
    zeros = (differing - _ONES) & ~differing & _HIGH_BITS
    lowest: Eights = zeros & np.negative(zeros)
    return lowest


def _without_points(characters: Eights, points: Eights) -> Eights:
    """Remove the points by moving the characters before them up by one."""
    begins = points >> _7  # the lowest bit of the byte
    before = begins - (points > 0)
    after = ~(before | ((points << _1) - begins))
    closed: Eights = ((characters & before) << _8) | (characters & after)
    # If the point was in the last eight, the last character before them moves in.
    is_last = points[0] > 0
    closed[0] |= np.where(is_last, characters[1] >> _56, _integer(0))
    closed[1] = np.where(is_last, characters[1] << _8, closed[1])
    return closed


def _n_decimals(points: Eights) -> Integers:
    """Number of decimals of each word, or `_NO_POINT`."""
    _, exponents = np.frexp(points[0].astype(np.float64) * 2.0**64 + points[1])
    found: Integers = _NO_POINT - (exponents >> 3)
    return found


def _numbers(digits: Eights) -> tuple[Eights, npt.NDArray[np.bool_]]:
    """Value of each group of eight digits, and for each word whether all are digits."""
    wrong = (digits | (digits + _SIXES)) & _HIGH_HALVES
    pairs = digits * _10 + (digits >> _8)
    even = (pairs & _QUARTERS) * _EVEN
    odd = ((pairs >> _16) & _QUARTERS) * _ODD
    return (even + odd) >> _32, (wrong[0] | wrong[1]) == 0
