"""Entropy decoding: "Bits", "Integers" and "Symbols" of docs/format.md."""

from collections import defaultdict
from dataclasses import dataclass

HALF, WORD = 2**32, 2**64


class DamagedError(Exception):
    """The bytes are not a valid stream."""


def need(condition, message="the stream is inconsistent"):
    """Raise DamagedError unless the condition holds."""
    if not condition:
        raise DamagedError(message)


def clip(number, low, high):
    return max(low, min(high, number))


def sign_class(number):
    """Return 0 for zero, 1 for positive and 2 for negative numbers."""
    return 0 if number == 0 else 1 if number > 0 else 2


class Model:
    """An adaptive bit: two probabilities of a 1, and the number of bits coded so far."""

    def __init__(self, probability=32768, count=0):
        self.fast = self.slow = probability
        self.count = count

    @property
    def probability(self):
        return clip((self.fast + self.slow) // 2, 32, 65504)

    def learn(self, bit):
        rate = 131072 // (2 * self.count + 3)
        self.fast = adapted(self.fast, max(rate, 1024), bit)
        self.slow = adapted(self.slow, rate, bit)
        self.count = min(self.count + 1, 256)


def adapted(x, rate, bit):
    return x + (65535 - x) * rate // 65536 if bit else x - x * rate // 65536


SYMBOLS, ONE, LEAST = 16, 32768, 2
SLOWEST, SLOWEST_IN_CONTEXT = 7, 5


class SymbolModel:
    """An adaptive symbol: the probability of a lower one than each, and the number coded, plus 1.

    The count is 0 before the first use of a model of a context.
    """

    def __init__(self, below=(), count=0):
        self.below, self.count = list(below), count

    def learn(self, symbol, slowest=SLOWEST):
        rate = min(self.count.bit_length(), slowest)
        for i in range(1, SYMBOLS):
            target = LEAST * i if i <= symbol else ONE - LEAST * (SYMBOLS - i)
            self.below[i] += (target - self.below[i]) // 2**rate
        self.count = min(self.count + 1, 128)


def new_symbol_model():
    return SymbolModel(range(0, ONE, ONE // SYMBOLS), 1)


class BitStream:
    """Range decoder of a bit stream."""

    def __init__(self, data):
        self.data, self.position = data, 8
        self.code = int.from_bytes(data[:8].ljust(8, b"\0"), "big")
        self.range = WORD - 1

    def bit(self, probability):
        split = probability * (self.range // 65536)
        bit = int(self.code < split)
        if bit:
            self.range = split
        else:
            self.range -= split
            self.code -= split
        self._renormalize()
        return bit

    def raw(self, n):
        self.range //= 2**n
        value = min(self.code // self.range, 2**n - 1)
        self.code -= value * self.range
        self._renormalize()
        return value

    def adaptive(self, model):
        bit = self.bit(model.probability)
        model.learn(bit)
        return bit

    def in_context(self, shared, context):
        """Read a bit with a shared model and the model of its context."""
        if not context.count:
            context.fast, context.slow = shared.fast, shared.slow
            context.count = min(shared.count, 3)
        bit = self.bit((3 * context.probability + shared.probability) // 4)
        context.learn(bit)
        shared.learn(bit)
        return bit

    def symbol(self, model):
        symbol = self._symbol_of(model.below)
        model.learn(symbol)
        return symbol

    def symbol_in_context(self, shared, context):
        """Read a symbol with a shared model and the model of its context."""
        if not context.count:
            context.below, context.count = list(shared.below), min(shared.count, 2)
        pairs = zip(shared.below, context.below, strict=True)
        symbol = self._symbol_of([a // 2 + b // 2 for a, b in pairs])
        shared.learn(symbol, SLOWEST_IN_CONTEXT)
        context.learn(symbol, SLOWEST_IN_CONTEXT)
        return symbol

    def _symbol_of(self, below):
        unit = self.range // ONE
        value = min(self.code // unit, ONE - 1)
        symbol = max(i for i in range(SYMBOLS) if below[i] <= value)
        self.code -= below[symbol] * unit
        self.range = ([*below, ONE][symbol + 1] - below[symbol]) * unit
        self._renormalize()
        return symbol

    def end(self):
        """Refuse nonzero bytes after those consumed."""
        need(not any(self.data[self.position :]), "the bit stream is followed by other bytes")

    def _renormalize(self):
        if self.range < HALF:
            word = self.data[self.position : self.position + 4].ljust(4, b"\0")
            self.position += 4
            self.code = (self.code * HALF + int.from_bytes(word, "big")) % WORD
            self.range = self.range * HALF % WORD


class NamedBits:
    """Adaptive bits of a stream by name, initially new."""

    def __init__(self, stream):
        self.stream = stream
        self.models = defaultdict(Model)

    def bit(self, name, context=None):
        """Read the adaptive bit of this name, together with that of the context if given."""
        shared = self.models[name]
        if context is None:
            return self.stream.adaptive(shared)
        return self.stream.in_context(shared, self.models[name, context])

    def count(self, name, context=None):
        """Read a count with the integer model of this name."""
        length = 0
        while length < 31 and self.bit((name, "longer", length), context):
            length += 1
        if length < 2:
            return length
        value = 2 + self.bit((name, "second", length), context)
        if length > 2:
            value = 2 * value + self.bit((name, "third", length, value))
        n_raw = length - 3
        while n_raw > 0:
            n = min(n_raw, 16)
            value = value * 2**n + self.stream.raw(n)
            n_raw -= n
        return value

    def integer(self, name, context=None, sign=0):
        """Read an adaptive integer; `sign` is the context g of its sign."""
        value = self.count(name, context)
        return -value if value and self.bit((name, "negative", sign), context) else value


def mean_class(past, max_class):
    """Return the context of the decaying mean P, two per doubling."""
    p = past + 4
    e = p.bit_length() - 1
    return min(max_class, 2 * (e - 2) + p // 2 ** (e - 1) % 2)


class TooLargeError(Exception):
    """Decoding would exceed the memory limit."""


@dataclass(frozen=True)
class Memory:
    """Memory limit of decoding, in bytes."""

    size: float = 2**30

    def check(self, size, what):
        """Raise TooLargeError if more bytes are needed."""
        if size > self.size:
            raise TooLargeError(
                f"{what}: needs {size:.3g} bytes of memory, limit {self.size:.3g}; pass a larger "
                "Memory to `read`"
            )


def stripped(data):
    """Return the data of a bit stream after checking that its last byte is not zero."""
    need(not data or data[-1], "a bit stream ends in a zero byte")
    return data


def integers(data, lengths, tables=None):
    """Return rows of integers: `integers(n1, n2, ...)` of the page."""
    stream = BitStream(stripped(data))
    bits, rows = NamedBits(stream), []
    for table, length in zip(tables or range(len(lengths)), lengths, strict=True):
        past, x, row = 0, 0, []
        for _ in range(length):
            x = bits.integer(table, mean_class(past, 23), sign_class(x))
            past = past // 2 + 2 * abs(x)
            row.append(x)
        rows.append(row)
    stream.end()
    return rows
