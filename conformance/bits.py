"""Bits of a stream, one by one: "Bits", "Integers" and "Mixed bits" of docs/format.md."""

from collections import defaultdict
from dataclasses import dataclass

HALF, WORD = 2**32, 2**64
NO_CONTEXT = None


class DamagedError(Exception):
    """The bytes are not those of a stream."""


def need(is_so, what="the stream contradicts itself"):
    """Nothing if it is so."""
    if not is_so:
        raise DamagedError(what)


def clip(number, low, high):
    """The nearest number in low..high."""
    return max(low, min(high, number))


def sign_class(number):
    """0 of 0, 1 of positive, 2 of negative numbers."""
    return 0 if number == 0 else 1 if number > 0 else 2


class Model:
    """An adaptive bit: two probabilities that it is 1, and how many bits it has seen."""

    def __init__(self, guess=32768, count=0):
        self.quick = self.slow = guess
        self.count = count

    @property
    def probability(self):
        return clip((self.quick + self.slow) // 2, 32, 65504)

    def learn(self, bit):
        rate = 131072 // (2 * self.count + 3)
        self.quick = moved(self.quick, max(rate, 1024), bit)
        self.slow = moved(self.slow, rate, bit)
        self.count = min(self.count + 1, 256)


def moved(x, rate, bit):
    return x + (65535 - x) * rate // 65536 if bit else x - x * rate // 65536


class BitStream:
    """A bit stream, which is a number in 0..1."""

    def __init__(self, data):
        self.data, self.position = data, 8
        self.left = int.from_bytes(data[:8].ljust(8, b"\0"), "big")
        self.range = WORD - 1

    def bit(self, probability):
        part = probability * (self.range // 65536)
        bit = int(self.left < part)
        if bit:
            self.range = part
        else:
            self.range -= part
            self.left -= part
        self._renew()
        return bit

    def raw(self, n):
        self.range //= 2**n
        value = min(self.left // self.range, 2**n - 1)
        self.left -= value * self.range
        self._renew()
        return value

    def adaptive(self, model):
        bit = self.bit(model.probability)
        model.learn(bit)
        return bit

    def in_context(self, every, here):
        """A bit that has a model for all, and one in its context."""
        if not here.count:
            here.quick, here.slow, here.count = every.quick, every.slow, min(every.count, 3)
        bit = self.bit((3 * here.probability + every.probability) // 4)
        here.learn(bit)
        every.learn(bit)
        return bit

    def end(self):
        """Refuse bytes behind those that were taken."""
        need(not any(self.data[self.position :]), "bytes are left over")

    def _renew(self):
        if self.range < HALF:
            word = self.data[self.position : self.position + 4].ljust(4, b"\0")
            self.position += 4
            self.left = (self.left * HALF + int.from_bytes(word, "big")) % WORD
            self.range = self.range * HALF % WORD


class NamedBits:
    """Adaptive bits by name, all new at first, of a stream."""

    def __init__(self, stream):
        self.stream = stream
        self.models = defaultdict(Model)

    def bit(self, name, context=NO_CONTEXT):
        """An adaptive bit of this name, if there is a context beside one of name and context."""
        every = self.models[name]
        if context is NO_CONTEXT:
            return self.stream.adaptive(every)
        return self.stream.in_context(every, self.models[name, context])

    def count(self, name, context=NO_CONTEXT):
        """An adaptive integer of at least 0, in the model of integers of this name."""
        length = 0
        while length < 31 and self.bit((name, "longer", length), context):
            length += 1
        if length < 2:
            return length
        value = 2 + self.bit((name, "second", length), context)
        if length > 2:
            value = 2 * value + self.bit((name, "third", length, value))
        left = length - 3
        while left > 0:
            part = min(left, 16)
            value = value * 2**part + self.stream.raw(part)
            left -= part
        return value

    def integer(self, name, context=NO_CONTEXT, sign=0):
        """An adaptive integer; `sign` is the context g of its sign."""
        value = self.count(name, context)
        return -value if value and self.bit((name, "negative", sign), context) else value


def mean_class(past, most):
    """The class of what came before, two for each doubling."""
    above = past + 4
    e = above.bit_length() - 1
    return min(most, 2 * (e - 2) + above // 2 ** (e - 1) % 2)


class TooLargeError(Exception):
    """Decoding would take more memory than the reader may."""


@dataclass(frozen=True)
class Memory:
    """Bytes that decoding may take at once."""

    size: float = 2**30

    def need(self, size, what):
        """Refuse what takes more bytes than allowed."""
        if size > self.size:
            raise TooLargeError(
                f"{what}: {size:.3g} bytes of memory are needed, {self.size:.3g} are allowed; give "
                "`read` a larger Memory"
            )


def stripped(data):
    """Data of a bit stream, which has no zero byte at its end."""
    need(not data or data[-1], "a zero byte is at the end")
    return data


def integers(data, lengths, tables=None):
    """Rows of integers: `integers(n1, n2, ...)` of the page."""
    stream = BitStream(stripped(data))
    bits, rows = NamedBits(stream), []
    for table, length in zip(tables or range(len(lengths)), lengths, strict=True):
        past, before, row = 0, 0, []
        for _ in range(length):
            before = bits.integer(table, mean_class(past, 23), sign_class(before))
            past = past // 2 + 2 * abs(before)
            row.append(before)
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


def inverse_of_squash():
    odds, x = [], -2047
    for p in range(4096):
        while x < 2047 and squash(x) < 16 * p + 8:
            x += 1
        odds.append(x)
    return odds


ODDS = inverse_of_squash()


def mixed_bit(stream, models, weights):
    """A bit that several models predict; weights, a list, are changed."""
    logits = [ODDS[one.probability // 16] if one.count else 0 for one in models]
    total = sum(o * w for o, w in zip(logits, weights, strict=True)) // 65536
    q = clip(squash(clip(total, -2047, 2047)), 24, 65512)
    bit = stream.bit(q)
    for i, (model, o) in enumerate(zip(models, logits, strict=True)):
        weights[i] = clip(weights[i] + o * (65536 * bit - q) // 2**14, -(2**20), 2**20)
        if not model.count:
            model.quick, model.slow, model.count = q, q, 1
        model.learn(bit)
    return bit
