"""Numbers over time on a graph, bit for bit: "Exact values" of docs/format.md."""

import struct
from collections import defaultdict

from conformance.bits import BitStream, Model, clip, need

LABELS, MEANS, FILTER, RAW = range(4)
FAR, LARGE = 2.0**1000, 1e100
TENS = {k: float(f"1e{k}") for k in range(-22, 39)}


def read_exact(data, shape, kind, neighbours):
    """Patterns of T frames of N rows of C numbers, as integers.

    `kind` is the letter of the number type in `struct`, `neighbours` those of each item.
    """
    return Reader(data, shape, kind, neighbours).read()


def double_bits(value):
    return struct.unpack("<Q", struct.pack("<d", value))[0]


def signed(number):
    """A number modulo 2^64, from 2^63 on below 0."""
    return (number + 2**63) % 2**64 - 2**63


def four_sums(terms):
    parts = [0.0, 0.0, 0.0, 0.0]
    for place, term in enumerate(terms):
        parts[place % 4] += term
    return (parts[0] + parts[1]) + (parts[2] + parts[3])


def mean(values):
    total = 0.0
    for value in values:
        total += value
    return total / len(values) if values else 0.0


def visit(neighbours):
    """The items in the order in which they are coded."""
    queues, counts, order = [[], [], [], []], [0] * len(neighbours), []
    come = [False] * len(neighbours)
    for _ in neighbours:
        item = None
        for queue in reversed(queues):
            while queue and item is None:
                first = queue.pop(0)
                item = None if come[first] else first
        item = come.index(False) if item is None else item
        come[item] = True
        order.append(item)
        for other in neighbours[item]:
            if not come[other] and counts[other] < 4:
                queues[counts[other]].append(other)
                counts[other] += 1
    return order


class Numbers:
    """Numbers of a type as indices."""

    def __init__(self, kind):
        self.kind, self.size = kind, struct.calcsize("<" + kind)
        self.letter = {1: "B", 2: "H", 4: "I", 8: "Q"}[self.size]
        self.is_float, self.sign = kind in "fd", 1 << (8 * self.size - 1)
        self.zeros = self.digits = self.places = 0
        self.scale = 8 * self.size
        self.largest = {"f": (2 - 2**-23) * 2.0**127, "d": (2 - 2**-52) * 2.0**1023}.get(kind)

    @property
    def rounding(self):
        """The least variance of an error."""
        return 2.0**-110 if self.is_float else 2.0 ** -(2 * self.scale + 4)

    def value(self, pattern):
        raw = struct.pack("<" + self.letter, pattern)
        return struct.unpack("<" + self.kind, raw)[0]

    def pattern(self, value):
        value = clip(value, -self.largest, self.largest)
        return struct.unpack("<" + self.letter, struct.pack("<" + self.kind, value))[0]

    def decade(self, value):
        last = self.places + 22
        fits = (m for m in range(last) if value < TENS[self.digits - self.places + m])
        return next(fits, last)

    def decimal(self, value):
        m, ten = self.decade(value), 10 ** (self.digits - 1)
        p, most = self.places - m, ten * (10 + 9 * (self.places + 22)) - 1
        count = value * TENS[p] if p >= 0 else value / TENS[-p]
        return min(int(count + 0.5) + 9 * m * ten, most) if count < 1e16 else most

    def index(self, pattern):
        if not self.is_float:
            return int(self.value(pattern))
        size = pattern & (self.sign - 1)
        found = self.decimal(self.value(size)) if self.digits else size >> self.zeros
        return -1 - found if pattern & self.sign else found

    def from_index(self, index):
        index %= 2**64
        if not self.is_float:
            return index % (2 * self.sign)
        negative = index >> 63
        index = 2**64 - 1 - index if negative else index
        plain = (index << self.zeros) & (self.sign - 1)
        found = self._from_decimal(index) if self.digits else plain
        return found | self.sign if negative else found

    def _from_decimal(self, index):
        ten, p = 10 ** (self.digits - 1), self.places
        index = min(index, ten * (10 + 9 * (self.places + 22)) - 1)
        while index >= 10 * ten:
            index -= 9 * ten
            p -= 1
        return self.pattern(index / TENS[p] if p >= 0 else index * TENS[-p])

    def known(self, pattern, expected):
        value = float(self.value(pattern)) * 2.0**-self.scale
        return value if -FAR <= value <= FAR else expected

    def expected(self, value, base, index):
        """The index expected for a known value, and the size of a step there."""
        if not self.is_float:
            move = clip((value - base) * 2.0**self.scale, -(2.0**62), 2.0**62)
            return index + int(move - 0.5 if move < 0 else move + 0.5), -16 * self.scale
        pattern = self.pattern(value * 2.0**self.scale)
        size = pattern & (self.sign - 1)
        if self.digits:
            found = self.decimal(self.value(size))
            step = 53 * (self.decade(self.value(size)) - self.places) - 16 * self.scale
        else:
            exponent, least = (size >> 52, 1074) if self.size == 8 else (size >> 23, 149)
            found = (size + (1 << self.zeros >> 1)) >> self.zeros
            step = 16 * (max(exponent - 1, 0) - least + self.zeros - self.scale)
        return (-1 - found if pattern & self.sign else found), max(step, -16000)


class Filter:
    """Weights of the inputs of an item, and their doubts."""

    def __init__(self, n, temporal, noise):
        self.weights = [1.0 / n for _ in range(n)] + temporal
        doubts = [1000.0 / (n + 1)] * n + [1000.0, 1000.0]
        self.doubts = [[d if i == j else 0.0 for i in range(n + 2)] for j, d in enumerate(doubts)]
        self.noise = self.quick = noise
        self.inputs, self.gains = [], []

    def move(self):
        return self.sum_of(self.weights, self.inputs)

    @staticmethod
    def sum_of(these, those):
        return four_sums(a * b for a, b in zip(these, those, strict=False))

    def variance(self):
        self.gains = [0.0] * len(self.inputs)
        for row, u in zip(self.doubts, self.inputs, strict=True):
            self.gains = [g + c * u for g, c in zip(self.gains, row, strict=True)]
        return self.sum_of(self.gains, self.inputs)

    def observe(self, error, variance):
        if not (0 < variance < LARGE and error * error < LARGE):
            return False
        r = 1.0 / variance
        step = error * r
        self.weights = [w + g * step for w, g in zip(self.weights, self.gains, strict=True)]
        for j, gain in enumerate(self.gains):
            along = gain * r
            row = zip(self.doubts[j], self.gains, strict=True)
            self.doubts[j] = [c - g * along for c, g in row]
        return True

    def fade(self):
        total = 0.0
        for i in range(len(self.doubts)):
            total += self.doubts[i][i]
        if total < 1000.0:
            self.doubts = [[c * (1.0 / 0.99) for c in row] for row in self.doubts]


class Reader:
    """A block that is read."""

    def __init__(self, data, shape, kind, neighbours):
        self.bits, self.numbers = BitStream(data), Numbers(kind)
        self.n_frames, self.n_items, self.width = shape
        self.neighbours, self.models = neighbours, defaultdict(Model)
        self.rows = [[None] * self.n_items for _ in range(self.n_frames)]

    def read(self):
        self.kind = self.bits.raw(2)
        if self.kind == RAW:
            for frame in self.rows:
                frame[:] = [[self._raw_number() for _ in range(self.width)] for _ in frame]
        else:
            self._read_head()
            self._read_items()
        self.bits.end()
        return self.rows

    def _raw_number(self):
        return int.from_bytes(bytes(self.bits.raw(8) for _ in range(self.numbers.size)), "little")

    def _bit(self, *name):
        return self.bits.adaptive(self.models[name])

    def _read_head(self):
        numbers, self.odd, self.still = self.numbers, 0, 1
        self.listed = self.kind == LABELS and self.bits.raw(1)
        if self.kind != LABELS:
            if numbers.is_float:
                numbers.zeros, numbers.digits, numbers.places, scale = map(
                    self.bits.raw, (6, 4, 5, 11)
                )
                need(numbers.zeros < 8 * numbers.size and numbers.places <= 22 and scale <= 2000)
                numbers.scale = scale - 1000
            self.odd, self.still = self.bits.raw(1), self.bits.raw(1)
        self.lags, lag = [0] * self.n_frames, 0
        if self.kind == FILTER and self.bits.raw(1):
            for t in range(1, self.n_frames):
                if not self._bit("lag"):
                    lag = self.bits.raw(28)
                self.lags[t] = lag if lag <= t else 0

    def _read_items(self):
        self.order = range(self.n_items) if self.listed else visit(self.neighbours)
        self.place = {item: place for place, item in enumerate(self.order)}
        items, frames, columns = self.n_items, self.n_frames, self.width
        self.known = [[[0.0] * columns for _ in range(frames)] for _ in range(items)]
        self.sizes = [[[0] * columns for _ in range(frames)] for _ in range(items)]
        self.moved = [[False] * frames for _ in range(items)]
        self.has_odd = [[False] * frames for _ in range(items)]
        self.constant, self.noises = [0] * items, [0.0] * items
        self.quick, self.slow, self.last = [0] * columns, [0] * columns, [0] * columns
        self.size_weights = [0, 32768, 32768, 8192, 0, 0, 0]
        self.temporal, self.last_odd = [0.0, 0.0], 0
        for item in self.order:
            self._read_item(item)

    def _find_near(self, item):
        most, place = (4 if self.kind == LABELS else 10), self.place
        here = {other for other in self.neighbours[item] if place[other] < place[item]}
        paths = defaultdict(int)
        for middle in self.neighbours[item]:
            if len(self.neighbours[middle]) <= 24:
                for other in self.neighbours[middle]:
                    if place[other] < place[item] and other not in here:
                        paths[other] += 1
        there = sorted(paths, key=lambda other: (-paths[other], -place[other]))
        found = (sorted(here, key=lambda other: -place[other]) + there)[:most]
        if self.listed and item:
            found = [item - 1, *(other for other in found if other != item - 1)][:most]
        return found

    def _read_item(self, item):
        self.item, self.near = item, self._find_near(item)
        near = self.near
        if self.n_frames > 1:
            k = 1 + sum(self.constant[j] for j in near[:2]) if near else 0
            self.constant[item] = self._bit("constant", k)
        if self.kind == FILTER:
            noise = mean([self.noises[j] for j in near])
            self.filter = Filter(len(near), list(self.temporal), noise)
        for t in range(self.n_frames):
            if t and self._repeats(t):
                self._repeat(t)
            elif self.kind == LABELS:
                self.moved[item][t] = True
                self.rows[t][item] = self._read_label(t)
            else:
                self._read_numbers(t)
        if self.kind == FILTER:
            self.noises[item] = self.filter.noise
            last = self.filter.weights[-2:]
            self.temporal = [f + (w - f) / 64 for f, w in zip(self.temporal, last, strict=True)]

    def _repeats(self, t):
        if self.constant[self.item] or not self.still:
            return self.constant[self.item]
        own = self.moved[self.item]
        past = (t > 1 and own[t - 1]) + 2 * (t > 2 and own[t - 2])
        return not self._bit("moved", sum(self.moved[j][t] for j in self.near[:4]), past)

    def _repeat(self, t):
        item = self.item
        self.rows[t][item] = list(self.rows[t - 1][item])
        self.has_odd[item][t] = self.has_odd[item][t - 1]
        if self.kind == LABELS:
            return
        self.known[item][t] = list(self.known[item][t - 1])
        for col, value in enumerate(self.known[item][t]):
            size = clip(self.numbers.expected(value, value, 0)[1] - 16, -16000, 16000)
            self.sizes[item][t][col] = self.last[col] = size

    def _read_label(self, t):
        rows, votes = [], []
        for j in [None, *self.near] if t > 1 else self.near:
            row = self.rows[t - 2][self.item] if j is None else self.rows[t][j]
            if row in rows:
                votes[rows.index(row)] += 1
            elif not t or row != self.rows[t - 1][self.item]:
                rows.append(row)
                votes.append(0 if j is None else 1)
        for i, row in enumerate(rows):
            if self._bit("candidate", t > 0, i, votes[i]):
                return list(row)
        return self._read_new_row(t)

    def _read_new_row(self, t):
        place, row = self.place[self.item], []
        base = [0] * self.width
        if t:
            base = self.rows[t - 1][self.item]
        elif place:
            base = self.rows[0][self.order[place - 1]]
        for col in range(self.width):
            off = self._difference(class_of(self.last[col] >> 4))
            self.last[col] += (16 * size_of(off) - self.last[col]) >> 2
            row.append(self.numbers.from_index(self.numbers.index(base[col]) + off))
        return row

    def _read_numbers(self, t):
        item, row = self.item, []
        self.rows[t][item], self.moved[item][t], self.others = row, True, 0
        for col in range(self.width):
            row.append(self._read_number(t, col))
        for col, size in enumerate(self.sizes[item][t]):
            if t < 2:
                self.quick[col] = self.slow[col] = 16 * size
            else:
                self.quick[col] += (16 * size - self.quick[col]) >> 2
                self.slow[col] += (16 * size - self.slow[col]) >> 4
        if t and self.kind == FILTER:
            self.filter.fade()

    def _expect(self, t, col):
        """The expected value, its base, the index of that and the variance."""
        near, known, variance = self.near, self.known, 0.0
        if t == 0:
            place = self.place[self.item]
            source = near[0] if near else self.order[place - 1] if place else None
            if source is None:
                return 0.0, 0.0, 0, variance
            base = known[source][0][col]
            value = mean([known[j][0][col] for j in near]) if near else base
            index = 0 if self.numbers.is_float else self.numbers.index(self.rows[0][source][col])
            return value, base, index, variance
        base = known[self.item][t - 1][col]
        if self.kind == FILTER:
            f = self.filter
            f.inputs = [known[j][t][col] - known[j][t - 1][col] for j in near]
            lag = self.lags[t]
            f.inputs.append(self._own_move(t - 1, t - 2, col) if t > 1 else 0.0)
            f.inputs.append(self._own_move(t - lag, t - 1, col) if lag else 0.0)
            value = base + f.move()
            variance = (f.variance() + min(f.noise, 4 * f.quick)) + self.numbers.rounding
        else:
            value = base + mean([known[j][t][col] - known[j][t - 1][col] for j in near[:6]])
        index = 0
        if not self.numbers.is_float:
            index = self.numbers.index(self.rows[t - 1][self.item][col])
        return value, base, index, variance

    def _own_move(self, to, start, col):
        def move(j):
            return self.known[j][to][col] - self.known[j][start][col]

        return move(self.item) - Filter.sum_of(self.filter.weights, map(move, self.near))

    def _expected_size(self, t, col, variance):
        near = self.near[:6]
        share = 65536 // len(near) if near else 0
        here = self.quick[col] >> 4 if t else self.last[col]
        if near:
            here = sum(self.sizes[j][t][col] for j in near) * share >> 16
        own = self.quick[col] >> 4 if t > 1 else here
        before = own
        if near and t:
            before = sum(self.sizes[j][t - 1][col] for j in near) * share >> 16
        top = max((self.sizes[j][t][col] for j in near), default=here)
        spread = own
        if variance > 0:
            half = (double_bits(min(variance, LARGE)) >> 48) - 16368
            spread = int(half / 2)
        past = own - (self.slow[col] >> 4) if t > 1 else 0
        others = self.others if col else 0
        raw = (16, here - own, others, before - own, past, top - here, spread - own)
        inputs = [clip(x, -128, 128) for x in raw]
        total = sum(x * w for x, w in zip(inputs, self.size_weights, strict=True))
        return own + (total >> 16), own, inputs

    def _read_number(self, t, col):
        numbers, item = self.numbers, self.item
        value, base, index, variance = self._expect(t, col)
        if not -FAR <= value <= FAR:
            value = base
        index, step = numbers.expected(value, base, index)
        size, own, inputs = self._expected_size(t, col, variance)
        if self.odd and self._read_odd(t):
            pattern, known, found = self.last_odd, value, clip(size, -16000, 16000)
        else:
            off = self._difference(class_of(size - step))
            pattern = numbers.from_index(index + off)
            known = numbers.known(pattern, value)
            found = clip(size_of(off) + step, -16000, 16000)
            missed = clip(found - size + 10, -64, 64)
            self.size_weights = [
                (w + (missed * x >> 3) + 2**31) % 2**32 - 2**31
                for w, x in zip(self.size_weights, inputs, strict=True)
            ]
            self._learn(t, col, known, value, variance)
        self.known[item][t][col], self.sizes[item][t][col] = known, found
        self.last[col] = found
        self.others = (self.others + found - own) >> 1 if col else found - own
        return pattern

    def _learn(self, t, col, known, value, variance):
        if self.kind != FILTER or not (t or self.near):
            return
        f = self.filter
        if t:
            error = known - value
            if f.observe(error, variance):
                f.noise += (error * error - f.noise) / 20
                f.quick += (error * error - f.quick) / 8
            return
        f.inputs = [self.known[j][0][col] - value for j in self.near] + [0.0, 0.0]
        squares, move = Filter.sum_of(f.inputs, f.inputs), f.move()
        variance = (f.variance() + 0.2 * (squares / len(self.near))) + self.numbers.rounding
        f.observe((known - value) - move, variance)

    def _read_odd(self, t):
        own = bool(t and self.has_odd[self.item][t - 1])
        if not self._bit("odd", own, sum(self.has_odd[j][t] for j in self.near[:2])):
            return False
        self.has_odd[self.item][t] = True
        if not self._bit("again"):
            raw = bytes(self.bits.raw(8) for _ in range(self.numbers.size))
            self.last_odd = int.from_bytes(raw, "big")
        return True

    def _difference(self, c):
        length = c >> 2
        if self._bit("above", c):
            length, i = length + 1, 0
            while length < 64 and self._bit("longer", c, i):
                length, i = length + 1, min(i + 1, 15)
        else:
            i = 0
            while length > 0 and self._bit("shorter", c, i):
                length, i = length - 1, min(i + 1, 15)
        if length == 0:
            return 0
        k, low, found = clip(length - (c >> 2) + 3, 0, 7), length - 1, 1
        if low:
            low, found = low - 1, 2 | self._bit("second", c, k)
        while low >= 24:
            low, found = low - 24, found << 24 | self.bits.raw(24)
        rest = self.bits.raw(low + 1)
        found = found << low | rest >> 1
        return signed(-found if rest & 1 else found)


def size_of(off):
    """Of a difference, in sixteenths of octaves."""
    twice = 2 * abs(off) + 1 if abs(off) < 2**62 else 2**64 - 1
    length = twice.bit_length()
    return 16 * (length - 2) + ((twice << 4 >> (length - 1)) & 15)


def class_of(size):
    return clip(size + 16, 0, 1023) >> 2
