"""Entropy decoding: "Bits", "Integers" and "Mixed bits" of docs/format.md."""

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


LOGISTIC = (
    *(22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743, 32768),
    *(40793, 47911, 53581, 57724, 60565, 62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438),
    *(65476, 65500, 65514),
)


def squash(x):
    i, r = divmod(x + 2048, 128)
    return (LOGISTIC[i] * (128 - r) + LOGISTIC[i + 1] * r) // 128


def inverse_squash():
    odds, x = [], -2047
    for p in range(4096):
        while x < 2047 and squash(x) < 16 * p + 8:
            x += 1
        odds.append(x)
    return odds


ODDS = inverse_squash()


def mixed_bit(stream, models, weights):
    """Read a bit predicted by several models; updates the list of weights."""
    logits = [ODDS[model.probability // 16] if model.count else 0 for model in models]
    total = sum(o * w for o, w in zip(logits, weights, strict=True)) // 65536
    q = clip(squash(clip(total, -2047, 2047)), 24, 65512)
    bit = stream.bit(q)
    for i, (model, o) in enumerate(zip(models, logits, strict=True)):
        weights[i] = clip(weights[i] + o * (65536 * bit - q) // 2**14, -(2**20), 2**20)
        if not model.count:
            model.fast, model.slow, model.count = q, q, 1
        model.learn(bit)
    return bit
