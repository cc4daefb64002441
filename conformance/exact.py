"""Lossless values over time on a graph: "Exact values" of docs/format.md."""

import struct
from collections import defaultdict

from conformance.bits import BitStream, Model, clip, need

LABELS, MEANS, FILTER, RAW = range(4)
MAX_VALUE, MAX_VARIANCE = 2.0**1000, 1e100
TENS = {k: float(f"1e{k}") for k in range(-22, 39)}


def read_exact(data, shape, kind, neighbors):
    """Return the bit patterns of T frames of N rows of C numbers, as integers.

    `kind` is the number type as a letter of `struct`, `neighbors` those of each item.
    """
    return Reader(data, shape, kind, neighbors).read()


def double_bits(value):
    return struct.unpack("<Q", struct.pack("<d", value))[0]


def signed(number):
    """Interpret a number modulo 2^64 as signed."""
    return (number + 2**63) % 2**64 - 2**63


def four_sums(terms):
    sums = [0.0, 0.0, 0.0, 0.0]
    for i, term in enumerate(terms):
        sums[i % 4] += term
    return (sums[0] + sums[1]) + (sums[2] + sums[3])


def mean(values):
    total = 0.0
    for value in values:
        total += value
    return total / len(values) if values else 0.0


def coding_order(neighbors):
    """Return the items in coding order."""
    queues, counts, order = [[], [], [], []], [0] * len(neighbors), []
    visited = [False] * len(neighbors)
    for _ in neighbors:
        item = None
        for queue in reversed(queues):
            while queue and item is None:
                first = queue.pop(0)
                item = None if visited[first] else first
        item = visited.index(False) if item is None else item
        visited[item] = True
        order.append(item)
        for other in neighbors[item]:
            if not visited[other] and counts[other] < 4:
                queues[counts[other]].append(other)
                counts[other] += 1
    return order


class Numbers:
    """Mapping between numbers of a type and their indices."""

    def __init__(self, kind):
        self.kind, self.size = kind, struct.calcsize("<" + kind)
        self.letter = {1: "B", 2: "H", 4: "I", 8: "Q"}[self.size]
        self.is_float, self.sign = kind in "fd", 1 << (8 * self.size - 1)
        self.zeros = self.digits = self.decimals = 0
        self.scale = 8 * self.size
        self.largest = {"f": (2 - 2**-23) * 2.0**127, "d": (2 - 2**-52) * 2.0**1023}.get(kind)

    @property
    def rounding(self):
        """Return the minimum variance of an error."""
        return 2.0**-110 if self.is_float else 2.0 ** -(2 * self.scale + 4)

    def value(self, pattern):
        raw = struct.pack("<" + self.letter, pattern)
        return struct.unpack("<" + self.kind, raw)[0]

    def pattern(self, value):
        value = clip(value, -self.largest, self.largest)
        return struct.unpack("<" + self.letter, struct.pack("<" + self.kind, value))[0]

    def decade(self, value):
        last = self.decimals + 22
        fits = (m for m in range(last) if value < TENS[self.digits - self.decimals + m])
        return next(fits, last)

    def decimal(self, value):
        m, ten = self.decade(value), 10 ** (self.digits - 1)
        p, max_index = self.decimals - m, ten * (10 + 9 * (self.decimals + 22)) - 1
        count = value * TENS[p] if p >= 0 else value / TENS[-p]
        return min(int(count + 0.5) + 9 * m * ten, max_index) if count < 1e16 else max_index

    def index(self, pattern):
        if not self.is_float:
            return int(self.value(pattern))
        magnitude = pattern & (self.sign - 1)
        index = self.decimal(self.value(magnitude)) if self.digits else magnitude >> self.zeros
        return -1 - index if pattern & self.sign else index

    def from_index(self, index):
        index %= 2**64
        if not self.is_float:
            return index % (2 * self.sign)
        negative = index >> 63
        index = 2**64 - 1 - index if negative else index
        shifted = (index << self.zeros) & (self.sign - 1)
        pattern = self._from_decimal(index) if self.digits else shifted
        return pattern | self.sign if negative else pattern

    def _from_decimal(self, index):
        ten, p = 10 ** (self.digits - 1), self.decimals
        index = min(index, ten * (10 + 9 * (self.decimals + 22)) - 1)
        while index >= 10 * ten:
            index -= 9 * ten
            p -= 1
        return self.pattern(index / TENS[p] if p >= 0 else index * TENS[-p])

    def known(self, pattern, predicted):
        value = float(self.value(pattern)) * 2.0**-self.scale
        return value if -MAX_VALUE <= value <= MAX_VALUE else predicted

    def predicted(self, value, base, index):
        """Return the index predicted by a known value, and the size of a step there."""
        if not self.is_float:
            change = clip((value - base) * 2.0**self.scale, -(2.0**62), 2.0**62)
            return index + int(change - 0.5 if change < 0 else change + 0.5), -16 * self.scale
        pattern = self.pattern(value * 2.0**self.scale)
        bits = pattern & (self.sign - 1)
        if self.digits:
            index = self.decimal(self.value(bits))
            step = 53 * (self.decade(self.value(bits)) - self.decimals) - 16 * self.scale
        else:
            exponent, bias = (bits >> 52, 1074) if self.size == 8 else (bits >> 23, 149)
            index = (bits + (1 << self.zeros >> 1)) >> self.zeros
            step = 16 * (max(exponent - 1, 0) - bias + self.zeros - self.scale)
        return (-1 - index if pattern & self.sign else index), max(step, -16000)


class Filter:
    """Weights of the inputs of an item, and their covariances."""

    def __init__(self, n, temporal, noise):
        self.weights = [1.0 / n for _ in range(n)] + temporal
        variances = [1000.0 / (n + 1)] * n + [1000.0, 1000.0]
        self.covariances = [
            [v if i == j else 0.0 for i in range(n + 2)] for j, v in enumerate(variances)
        ]
        self.noise = self.fast_noise = noise
        self.inputs, self.gains = [], []

    def change(self):
        return self.sum_of(self.weights, self.inputs)

    @staticmethod
    def sum_of(these, those):
        return four_sums(a * b for a, b in zip(these, those, strict=False))

    def variance(self):
        self.gains = [0.0] * len(self.inputs)
        for row, u in zip(self.covariances, self.inputs, strict=True):
            self.gains = [g + c * u for g, c in zip(self.gains, row, strict=True)]
        return self.sum_of(self.gains, self.inputs)

    def observe(self, error, variance):
        if not (0 < variance < MAX_VARIANCE and error * error < MAX_VARIANCE):
            return False
        r = 1.0 / variance
        step = error * r
        self.weights = [w + g * step for w, g in zip(self.weights, self.gains, strict=True)]
        for j, gain in enumerate(self.gains):
            along = gain * r
            row = zip(self.covariances[j], self.gains, strict=True)
            self.covariances[j] = [c - g * along for c, g in row]
        return True

    def fade(self):
        total = 0.0
        for i in range(len(self.covariances)):
            total += self.covariances[i][i]
        if total < 1000.0:
            self.covariances = [[c * (1.0 / 0.99) for c in row] for row in self.covariances]


class Reader:
    """Reader of a block of exact values."""

    def __init__(self, data, shape, kind, neighbors):
        self.bits, self.numbers = BitStream(data), Numbers(kind)
        self.n_frames, self.n_items, self.width = shape
        self.neighbors, self.models = neighbors, defaultdict(Model)
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
        numbers, self.has_special, self.still = self.numbers, 0, 1
        self.listed = self.kind == LABELS and self.bits.raw(1)
        if self.kind != LABELS:
            if numbers.is_float:
                numbers.zeros, numbers.digits, numbers.decimals, scale = map(
                    self.bits.raw, (6, 4, 5, 11)
                )
                need(numbers.zeros < 8 * numbers.size and numbers.decimals <= 22 and scale <= 2000)
                numbers.scale = scale - 1000
            self.has_special, self.still = self.bits.raw(1), self.bits.raw(1)
        self.lags, lag = [0] * self.n_frames, 0
        if self.kind == FILTER and self.bits.raw(1):
            for t in range(1, self.n_frames):
                if not self._bit("lag"):
                    lag = self.bits.raw(28)
                self.lags[t] = lag if lag <= t else 0

    def _read_items(self):
        self.order = range(self.n_items) if self.listed else coding_order(self.neighbors)
        self.position = {item: position for position, item in enumerate(self.order)}
        items, frames, columns = self.n_items, self.n_frames, self.width
        self.known = [[[0.0] * columns for _ in range(frames)] for _ in range(items)]
        self.sizes = [[[0] * columns for _ in range(frames)] for _ in range(items)]
        self.moved = [[False] * frames for _ in range(items)]
        self.special = [[False] * frames for _ in range(items)]
        self.constant, self.noises = [0] * items, [0.0] * items
        self.fast, self.slow, self.last = [0] * columns, [0] * columns, [0] * columns
        self.size_weights = [0, 32768, 32768, 8192, 0, 0, 0]
        self.temporal, self.last_special = [0.0, 0.0], 0
        for item in self.order:
            self._read_item(item)

    def _find_predictors(self, item):
        n_max, position = (4 if self.kind == LABELS else 10), self.position
        adjacent = {other for other in self.neighbors[item] if position[other] < position[item]}
        paths = defaultdict(int)
        for middle in self.neighbors[item]:
            if len(self.neighbors[middle]) <= 24:
                for other in self.neighbors[middle]:
                    if position[other] < position[item] and other not in adjacent:
                        paths[other] += 1
        further = sorted(paths, key=lambda other: (-paths[other], -position[other]))
        items = (sorted(adjacent, key=lambda other: -position[other]) + further)[:n_max]
        if self.listed and item:
            items = [item - 1, *(other for other in items if other != item - 1)][:n_max]
        return items

    def _read_item(self, item):
        self.item, self.near = item, self._find_predictors(item)
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
        self.special[item][t] = self.special[item][t - 1]
        if self.kind == LABELS:
            return
        self.known[item][t] = list(self.known[item][t - 1])
        for col, value in enumerate(self.known[item][t]):
            size = clip(self.numbers.predicted(value, value, 0)[1] - 16, -16000, 16000)
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
        position, row = self.position[self.item], []
        base = [0] * self.width
        if t:
            base = self.rows[t - 1][self.item]
        elif position:
            base = self.rows[0][self.order[position - 1]]
        for col in range(self.width):
            difference = self._difference(class_of(self.last[col] >> 4))
            self.last[col] += (16 * size_of(difference) - self.last[col]) >> 2
            row.append(self.numbers.from_index(self.numbers.index(base[col]) + difference))
        return row

    def _read_numbers(self, t):
        item, row = self.item, []
        self.rows[t][item], self.moved[item][t], self.excess = row, True, 0
        for col in range(self.width):
            row.append(self._read_number(t, col))
        for col, size in enumerate(self.sizes[item][t]):
            if t < 2:
                self.fast[col] = self.slow[col] = 16 * size
            else:
                self.fast[col] += (16 * size - self.fast[col]) >> 2
                self.slow[col] += (16 * size - self.slow[col]) >> 4
        if t and self.kind == FILTER:
            self.filter.fade()

    def _predict(self, t, col):
        """Return the predicted value, its base, the index of the base and the variance."""
        near, known, variance = self.near, self.known, 0.0
        if t == 0:
            position = self.position[self.item]
            source = near[0] if near else self.order[position - 1] if position else None
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
            f.inputs.append(self._own_motion(t - 1, t - 2, col) if t > 1 else 0.0)
            f.inputs.append(self._own_motion(t - lag, t - 1, col) if lag else 0.0)
            value = base + f.change()
            variance = (f.variance() + min(f.noise, 4 * f.fast_noise)) + self.numbers.rounding
        else:
            value = base + mean([known[j][t][col] - known[j][t - 1][col] for j in near[:6]])
        index = 0
        if not self.numbers.is_float:
            index = self.numbers.index(self.rows[t - 1][self.item][col])
        return value, base, index, variance

    def _own_motion(self, to, start, col):
        def motion(j):
            return self.known[j][to][col] - self.known[j][start][col]

        return motion(self.item) - Filter.sum_of(self.filter.weights, map(motion, self.near))

    def _predicted_size(self, t, col, variance):
        near = self.near[:6]
        share = 65536 // len(near) if near else 0
        here = self.fast[col] >> 4 if t else self.last[col]
        if near:
            here = sum(self.sizes[j][t][col] for j in near) * share >> 16
        own = self.fast[col] >> 4 if t > 1 else here
        before = own
        if near and t:
            before = sum(self.sizes[j][t - 1][col] for j in near) * share >> 16
        top = max((self.sizes[j][t][col] for j in near), default=here)
        spread = own
        if variance > 0:
            half = (double_bits(min(variance, MAX_VARIANCE)) >> 48) - 16368
            spread = int(half / 2)
        past = own - (self.slow[col] >> 4) if t > 1 else 0
        excess = self.excess if col else 0
        inputs = (16, here - own, excess, before - own, past, top - here, spread - own)
        inputs = [clip(x, -128, 128) for x in inputs]
        total = sum(x * w for x, w in zip(inputs, self.size_weights, strict=True))
        return own + (total >> 16), own, inputs

    def _read_number(self, t, col):
        numbers, item = self.numbers, self.item
        value, base, index, variance = self._predict(t, col)
        if not -MAX_VALUE <= value <= MAX_VALUE:
            value = base
        index, step = numbers.predicted(value, base, index)
        size, own, inputs = self._predicted_size(t, col, variance)
        if self.has_special and self._read_special(t):
            pattern, known, new_size = self.last_special, value, clip(size, -16000, 16000)
        else:
            difference = self._difference(class_of(size - step))
            pattern = numbers.from_index(index + difference)
            known = numbers.known(pattern, value)
            new_size = clip(size_of(difference) + step, -16000, 16000)
            error = clip(new_size - size + 10, -64, 64)
            self.size_weights = [
                (w + (error * x >> 3) + 2**31) % 2**32 - 2**31
                for w, x in zip(self.size_weights, inputs, strict=True)
            ]
            self._learn(t, col, known, value, variance)
        self.known[item][t][col], self.sizes[item][t][col] = known, new_size
        self.last[col] = new_size
        self.excess = (self.excess + new_size - own) >> 1 if col else new_size - own
        return pattern

    def _learn(self, t, col, known, value, variance):
        if self.kind != FILTER or not (t or self.near):
            return
        f = self.filter
        if t:
            error = known - value
            if f.observe(error, variance):
                f.noise += (error * error - f.noise) / 20
                f.fast_noise += (error * error - f.fast_noise) / 8
            return
        f.inputs = [self.known[j][0][col] - value for j in self.near] + [0.0, 0.0]
        squares, change = Filter.sum_of(f.inputs, f.inputs), f.change()
        variance = (f.variance() + 0.2 * (squares / len(self.near))) + self.numbers.rounding
        f.observe((known - value) - change, variance)

    def _read_special(self, t):
        own = bool(t and self.special[self.item][t - 1])
        if not self._bit("special", own, sum(self.special[j][t] for j in self.near[:2])):
            return False
        self.special[self.item][t] = True
        if not self._bit("again"):
            raw = bytes(self.bits.raw(8) for _ in range(self.numbers.size))
            self.last_special = int.from_bytes(raw, "big")
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
        k, n_raw, magnitude = clip(length - (c >> 2) + 3, 0, 7), length - 1, 1
        if n_raw:
            n_raw, magnitude = n_raw - 1, 2 | self._bit("second", c, k)
        while n_raw >= 24:
            n_raw, magnitude = n_raw - 24, magnitude << 24 | self.bits.raw(24)
        rest = self.bits.raw(n_raw + 1)
        magnitude = magnitude << n_raw | rest >> 1
        return signed(-magnitude if rest & 1 else magnitude)


def size_of(difference):
    """Return the size of a difference in sixteenths of octaves."""
    twice = 2 * abs(difference) + 1 if abs(difference) < 2**62 else 2**64 - 1
    length = twice.bit_length()
    return 16 * (length - 2) + ((twice << 4 >> (length - 1)) & 15)


def class_of(size):
    return clip(size + 16, 0, 1023) >> 2
