"""Tables of numbers, exactly: "Patterns" of docs/format.md."""

import struct

from conformance.bits import BitStream, NamedBits, mean_class, sign_class, stripped
from conformance.rounding import single

LARGEST = {"f": (2 - 2**-23) * 2.0**127, "d": (2 - 2**-52) * 2.0**1023}
BITS = {"B": 8, "i": 32, "f": 32, "d": 64}
"""Number types by their letters of `struct`."""


def row_before(n_rows):
    """Each row is expected to be as the one before."""
    return [(row, [(row - 1,)] if row else []) for row in range(n_rows)]


def nothing(n_rows):
    """Nothing is expected."""
    return [(row, []) for row in range(n_rows)]


def same_step(n_rows):
    """Each row is expected as far from the one before as that from its own."""
    return row_before(min(n_rows, 2)) + [
        (row, [(row - 1, row - 1, row - 2)]) for row in range(2, n_rows)
    ]


class Numbers:
    """Numbers of a type as integers of B bits, and back."""

    def __init__(self, kind):
        self.kind, self.bits = kind, BITS[kind]
        self.letter = {32: "I", 64: "Q", 8: "B"}[self.bits]

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

    def expected(self, near):
        """The integer expected from the numbers of a column in each row that is named."""
        if not near:
            return self.as_integer(0)
        if len(near[0]) == 1:
            return near[0][0]
        found = [tuple(map(self.as_number, triple)) for triple in near]
        if self.kind in "Bi":
            mean = (2 * sum(a + b - c for a, b, c in found) + len(found)) // (2 * len(found))
            low, high = (0, 255) if self.kind == "B" else (-(2**31), 2**31 - 1)
            return self.as_integer(max(low, min(high, mean)))
        total = 0.0
        for a, b, c in found:
            total += a + b - c
        mean = total / len(found)
        if not abs(mean) <= LARGEST[self.kind]:
            return near[0][0]
        return self.as_integer(single(mean) if self.kind == "f" else mean)


def signed_magnitude(bits, most_bits, context, sign_name):
    """A number in the table of a pattern, of up to `most_bits` bits."""
    length = 0
    while length < most_bits and bits.bit(("longer", length), context):
        length += 1
    value = min(length, 1)
    if length > 1:
        value = 2 + bits.bit(("second", length), context)
    if length > 2:
        value = 2 * value + bits.bit(("third", length, value))
    for place in reversed(range(length - 3)):
        value = 2 * value + bits.bit(("low", place))
    return -value if value and bits.bit(("negative", sign_name)) else value


def read_patterns(data, width, kind, expected):
    """Rows of `kind` by number, as the bytes of each: `patterns(N, C)` of the page.

    Parameters
    ----------
    expected : list of (row, sources)
        In the order in which rows are coded: the number of each, and a list of the rows that it is
        expected from: triples, a single one in a tuple, or nothing.
    """
    stream = BitStream(stripped(data))
    bits, numbers = NamedBits(stream), Numbers(kind)
    rows, recent, again = {}, [], [0, 0]
    past, signs = [0] * width, [0] * width
    for row, sources in expected:
        again.append(bits.bit(("again", 2 * again[-2] + again[-1])) if recent else 0)
        if again[-1]:
            node = 1
            for _ in range(6):
                node = 2 * node + bits.bit(("which", node))
            rows[row] = recent.pop(min(node - 64, len(recent) - 1))
        else:
            way, before, values = min(len(sources[0]) if sources else 0, 2), 0, []
            for k in range(width):
                context = way, mean_class(past[k], 47)
                d = signed_magnitude(bits, numbers.bits, context, (signs[k], before))
                past[k] = past[k] // 2 + 2 * min(abs(d), 2**48)
                signs[k] = before = sign_class(d)
                near = [tuple(rows[one][k] for one in source) for source in sources]
                values.append((numbers.expected(near) + d) % 2**numbers.bits)
            rows[row] = tuple(values)
        recent = [rows[row], *recent][:64]
    stream.end()
    return [tuple(map(numbers.as_pattern, rows[row])) for row in range(len(expected))]
