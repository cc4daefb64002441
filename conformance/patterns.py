"""Lossless tables of numbers: "Patterns" of docs/format.md."""

import math
import struct
from dataclasses import dataclass

from conformance.bits import BitStream, NamedBits, mean_class, sign_class, stripped
from conformance.rounding import single


@dataclass
class Stencil:
    """Rows that predict a row by a weighted sum."""

    rows: list
    weights: list


LARGEST = {"f": (2 - 2**-23) * 2.0**127, "d": (2 - 2**-52) * 2.0**1023}
BITS = {"B": 8, "i": 32, "f": 32, "d": 64}
"""Number types by their letters of `struct`."""


def row_before(n_rows):
    """Predict each row from the previous one."""
    return [(row, [(row - 1,)] if row else []) for row in range(n_rows)]


def nothing(n_rows):
    """Predict each row from nothing."""
    return [(row, []) for row in range(n_rows)]


def same_step(n_rows):
    """Predict each row by linear extrapolation from the previous two."""
    return row_before(min(n_rows, 2)) + [
        (row, [(row - 1, row - 1, row - 2)]) for row in range(2, n_rows)
    ]


class Numbers:
    """Mapping between numbers of a type and integers of B bits."""

    def __init__(self, kind):
        self.kind, self.bits = kind, BITS[kind]
        self.letter = {32: "I", 64: "Q", 8: "B"}[self.bits]
        self.low, self.high = (0, 255) if kind == "B" else (-(2**31), 2**31 - 1)

    def as_integer(self, number):
        (pattern,) = struct.unpack("<" + self.letter, struct.pack("<" + self.kind, number))
        if self.kind in "Bi":
            return pattern
        highest = 2 ** (self.bits - 1)
        return 2 * highest - 1 - pattern if pattern >= highest else pattern + highest

    def as_pattern(self, integer):
        highest = 2 ** (self.bits - 1)
        if self.kind in "fd":
            integer = integer - highest if integer >= highest else 2 * highest - 1 - integer
        return struct.pack("<" + self.letter, integer)

    def as_number(self, integer):
        return struct.unpack("<" + self.kind, self.as_pattern(integer))[0]

    def weighted(self, known, weights):
        """Return the integer predicted from those of a column in the rows of a stencil."""
        values, total = list(map(self.as_number, known)), 0.0
        for value, weight in zip(values, weights, strict=True):
            total += weight * (value - values[0])
        mean = values[0] + total
        if self.kind in "Bi":
            mean = min(max(mean, float(self.low)), float(self.high))
            return self.as_integer(math.trunc(mean + (-0.5 if mean < 0 else 0.5)))
        return self.rounded(mean, known[0])

    def rounded(self, mean, otherwise):
        """Return the integer of a float, or another one if its type has no such number."""
        if not abs(mean) <= LARGEST[self.kind]:
            return otherwise
        return self.as_integer(single(mean) if self.kind == "f" else mean)

    def predicted(self, sources):
        """Return the integer predicted from those of a column: triples, one, or none."""
        if not sources:
            return self.as_integer(0)
        if len(sources[0]) == 1:
            return sources[0][0]
        triples = [tuple(map(self.as_number, triple)) for triple in sources]
        if self.kind in "Bi":
            mean = (2 * sum(a + b - c for a, b, c in triples) + len(triples)) // (2 * len(triples))
            return self.as_integer(max(self.low, min(self.high, mean)))
        total = 0.0
        for a, b, c in triples:
            total += a + b - c
        return self.rounded(total / len(triples), sources[0][0])


def read_difference(bits, max_bits, context, signs):
    """Read a difference of up to `max_bits` bits; `signs` is the context of its sign."""
    length = 0
    while length < max_bits and bits.bit(("longer", length), context):
        length += 1
    value = min(length, 1)
    if length > 1:
        value = 2 + bits.bit(("second", length), context)
    if length > 2:
        value = 2 * value + bits.bit(("third", length, value))
    for position in reversed(range(length - 3)):
        value = 2 * value + bits.bit(("low", position))
    return -value if value and bits.bit(("negative", signs)) else value


def read_patterns(data, width, kind, predictors):
    """Return the bytes of each row of `patterns(N, C)` of the page.

    Parameters
    ----------
    width : int
        C.
    kind : str
        Number type, as a letter of `struct`.
    predictors : list of (row, sources)
        Rows in coding order, each with a list of the rows that predict it: triples, a single one
        in a tuple, or nothing; or with a `Stencil`.
    """
    stream = BitStream(stripped(data))
    bits, numbers = NamedBits(stream), Numbers(kind)
    rows, recent, again = {}, [], [0, 0]
    past, signs = [0] * width, [0] * width
    for row, sources in predictors:
        again.append(bits.bit(("again", 2 * again[-2] + again[-1])) if recent else 0)
        if again[-1]:
            node = 1
            for _ in range(6):
                node = 2 * node + bits.bit(("which", node))
            rows[row] = recent.pop(min(node - 64, len(recent) - 1))
        else:
            is_weighted, sign, values = isinstance(sources, Stencil), 0, []
            predictor = 2 if is_weighted else min(len(sources[0]) if sources else 0, 2)
            for k in range(width):
                context = predictor, mean_class(past[k], 47)
                d = read_difference(bits, numbers.bits, context, (signs[k], sign))
                past[k] = past[k] // 2 + 2 * min(abs(d), 2**48)
                signs[k] = sign = sign_class(d)
                if is_weighted:
                    known = [rows[i][k] for i in sources.rows]
                    predicted = numbers.weighted(known, sources.weights)
                else:
                    known = [tuple(rows[i][k] for i in source) for source in sources]
                    predicted = numbers.predicted(known)
                values.append((predicted + d) % 2**numbers.bits)
            rows[row] = tuple(values)
        recent = [rows[row], *recent][:64]
    stream.end()
    return [tuple(map(numbers.as_pattern, rows[row])) for row in range(len(predictors))]
