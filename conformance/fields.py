"""Integers of fields: "Fields" of docs/format.md."""

from collections import defaultdict

from conformance.bits import BitStream, Model, clip, stripped


def log(number):
    octave = number.bit_length() - 1
    return 16 * octave + 16 * number // 2**octave - 16


def size(n):
    return (16 + n % 16) * 2 ** (n // 16) // 16


def share(n):
    return 65536 * size(n) // (size(n) + 4096)


def signed(number):
    """Reduce a number modulo 2^32 to -2^31..2^31-1."""
    return (number + 2**31) % 2**32 - 2**31


class Models:
    """The adaptive bits in their initial states."""

    def __init__(self):
        self.any, self.longer, self.upper = {}, {}, {}
        for c in range(48):
            t = share(8 * c + 4)
            self.any[c] = Model(t, 32)
            for k in range(1, 32):
                g = max(t, 4096)
                self.longer[k, c] = Model(g, 32)
                self.upper[k + 1, c] = Model(65536 * g // (65536 + g), 32)
                t = t * t // 65536
        self.wrong = [Model(32768, 8) for _ in range(16)]
        self.becomes_active = [[[Model(16384, 8) for _ in range(16)] for _ in "01"] for _ in "01"]


class FieldReader:
    """Reader of rows of fields.

    Parameters
    ----------
    data : bytes
    passes : list of dict of int to list of int
        For each pass, the context neighbors of each of its columns, in coding order. A column
        can be listed repeatedly.
    """

    def __init__(self, data, passes):
        self.stream, self.models, self.passes = BitStream(data), Models(), passes
        self.near = {i: near for columns in passes for i, near in columns.items()}
        self.sums = {i: [4096] * 3 for i in self.near}
        self.neighbor_means = dict.fromkeys(self.near, 192)
        self.agreements = {i: [16] * len(near) for i, near in self.near.items()}
        self.weights = [0, 0, 16384, 16384, 8192, 8192, 24576, 8192, -16384]
        self.means, self.bias = [32768] * len(passes), [0] * len(passes)
        self.n_zero_rows = defaultdict(int)

    def read_row(self, row):
        """Return the values of a row, by column."""
        self.values, self.magnitudes, coded = {}, dict.fromkeys(self.near, 0), set()
        self.a = self.b = 256
        self.g = self.h = 0
        for number, neighbors in enumerate(self.passes):
            columns, active = list(neighbors), 1
            for start in range(0, len(columns), 64):
                group, key = columns[start : start + 64], (number, start)
                if len(group) == 64 and self.n_zero_rows[key] and self.is_zero(group, key, active):
                    self.values |= dict.fromkeys(group, 0)
                    self.g = self.h = 0
                    self.means[number] >>= 4
                else:
                    for i in group:
                        self.values[i] = self.read_value(number, i)
                    coded.update(group)
                active = int(any(self.values[i] for i in group))
                self.n_zero_rows[key] = 0 if active else min(self.n_zero_rows[key] + 1, 15)
        self.end_row(row, coded)
        return self.values

    def is_zero(self, group, key, active):
        near = int(any(self.magnitudes[j] for i in group for j in self.near[i]))
        model = self.models.becomes_active[active][near][self.n_zero_rows[key]]
        return not self.stream.adaptive(model)

    def inputs(self, number, i):
        fast, medium, slow = self.sums[i]
        s, near = log(slow + 16), self.near[i]
        d = 4096 // len(near) if near else 0
        largest = max((self.magnitudes[j] for j in near), default=0)
        mean = log(d * sum(self.magnitudes[j] for j in near) + 100)
        row = log(self.a) - log(self.b)
        return s, [
            32,
            log(fast + 16) - s,
            mean - self.neighbor_means[i] if near else 0,
            row,
            self.neighbor_means[i] - s if near else 0,
            log(self.means[number] + 16) - s,
            log(medium + 16) - s,
            log(self.g + 32) - log(self.h + 32) - row,
            log(4096 * largest + 100) - mean,
        ]

    def read_value(self, number, i):
        s, x = self.inputs(number, i)
        self.weights[0] = self.bias[number]
        total = sum(w * x_j for w, x_j in zip(self.weights, x, strict=True))
        level = clip(s + (total >> 16), 0, 383)
        value = 0
        if self.stream.adaptive(self.models.any[level // 8]):
            value = self.read_sign(i, self.read_magnitude(level // 8))
        m = self.magnitudes[i] = min(abs(value), 4095)
        if value or share(level) > 4096:
            error = min(m * (65536 - share(level)), 2**19) - share(level)
            steps = [(error * x_j + 2048) >> 12 for x_j in x]
            self.weights = [signed(w + step) for w, step in zip(self.weights, steps, strict=True)]
            self.bias[number] = self.weights[0]
        self.update_means(number, m, self.sums[i][2])
        return value

    def read_magnitude(self, c):
        k = 1
        while k < 31 and self.stream.adaptive(self.models.longer[k, c]):
            k += 1
        if k == 1:
            return 1
        value, n_raw = 2 + self.stream.adaptive(self.models.upper[k, c]), k - 2
        while n_raw:
            n = min(n_raw, 16)
            value = value << n | self.stream.raw(n)
            n_raw -= n
        return value

    def read_sign(self, i, magnitude):
        signs = [(self.values[j] > 0) - (self.values[j] < 0) for j in self.near[i]]
        agreements = self.agreements[i]
        vote = sum(a * sign for a, sign in zip(agreements, signs, strict=True))
        wrong = self.stream.adaptive(self.models.wrong[abs(vote).bit_length()])
        own = -1 if wrong != (vote < 0) else 1
        for n, sign in enumerate(signs):
            if sign:
                agreements[n] += 16 * own * sign - (agreements[n] >> 3)
        return own * magnitude

    def update_means(self, number, m, slow):
        self.g += 256 * m - (self.g >> 2)
        self.h += (slow >> 4) - (self.h >> 2)
        self.a += 16 * m
        self.b += slow >> 8
        if max(self.a, self.b) >= 2**23:
            self.a, self.b = self.a >> 1 | 1, self.b >> 1 | 1
        self.means[number] += (4096 * m - self.means[number]) >> 4

    def end_row(self, row, coded):
        for i in coded:
            sums = self.sums[i]
            for n in range(3):
                sums[n] += (4096 * self.magnitudes[i] - sums[n]) >> (n + 1)
        for position, (i, near) in enumerate(self.near.items()):
            if i in coded and (row < 4 or position % 4 == row % 4):
                d = 4096 // len(near) if near else 0
                self.neighbor_means[i] = d * sum(log(self.sums[j][2] + 16) for j in near) >> 12


def read_fields(data, n_rows, passes):
    """Return rows of integers by column: `fields(K, N)` of the page; passes as in `FieldReader`."""
    n_columns = sum(map(len, passes))
    reader = FieldReader(stripped(data), passes)
    rows = [reader.read_row(row) for row in range(n_rows)]
    reader.stream.end()
    return [[values[i] for i in range(n_columns)] for values in rows]
