"""A decoder of fields in plain Python, slow, and written from the words of `docs/format.md`."""

BYTE, WORD, ALL = 2**8, 2**32, 2**64


def clip(number, low, high):
    return max(low, min(high, number))


def log(number):
    octave = number.bit_length() - 1
    return 16 * octave + 16 * number // 2**octave - 16


def size(n):
    return (16 + n % 16) * 2 ** (n // 16) // 16


def share(n):
    return 65536 * size(n) // (size(n) + 4096)


def signed(number):
    """A number of -2^31..2^31-1, modulo 2^32."""
    return (number + 2**31) % WORD - 2**31


class BitStream:
    """ "Bits": what is read from a bit stream."""

    def __init__(self, data):
        self.data, self.position = data, 8
        self.left = int.from_bytes(data[:8].ljust(8, b"\0"), "big")
        self.range = ALL - 1

    def renew(self):
        if self.range < WORD:
            word = self.data[self.position : self.position + 4].ljust(4, b"\0")
            self.position += 4
            self.range = self.range * WORD % ALL
            self.left = (self.left * WORD + int.from_bytes(word, "big")) % ALL

    def bit(self, probability):
        part = probability * (self.range // 65536)
        bit = self.left < part
        if bit:
            self.range = part
        else:
            self.range -= part
            self.left -= part
        self.renew()
        return int(bit)

    def raw(self, n):
        self.range //= 2**n
        value = min(self.left // self.range, 2**n - 1)
        self.left -= value * self.range
        self.renew()
        return value

    def adaptive(self, model):
        bit = self.bit(model.probability)
        model.learn(bit)
        return bit

    def ends_well(self):
        return not any(self.data[self.position :])


class Model:
    def __init__(self, guess, count):
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


class Models:
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


class Reader:
    """Rows of fields, from the columns of each pass and the neighbours of each column.

    Parameters
    ----------
    data : bytes
    passes : list of dict of int to list of int
        Of each pass, the neighbours of each of its columns, in order.
    """

    def __init__(self, data, passes):
        self.stream, self.models, self.passes = BitStream(data), Models(), passes
        self.near = {i: near for one in passes for i, near in one.items()}
        self.sums = {i: [4096] * 3 for i in self.near}
        self.usual = dict.fromkeys(self.near, 192)
        self.agreement = {(i, j): 16 for i, near in self.near.items() for j in near}
        self.weights = [0, 0, 16384, 16384, 8192, 8192, 24576, 8192, -16384]
        self.means, self.bias = [32768] * len(passes), [0] * len(passes)

    def read_row(self, row):
        """Values of a row, by column."""
        self.values, self.magnitudes = {}, {}
        self.a = self.b = 256
        self.g = self.h = 0
        for number, one in enumerate(self.passes):
            for i in one:
                self.values[i] = self.read_value(number, i)
        self.end_row(row)
        return self.values

    def inputs(self, number, i):
        fast, middle, slow = self.sums[i]
        s, near = log(slow + 16), self.near[i]
        d = 4096 // len(near) if near else 0
        most = max((self.magnitudes[j] for j in near), default=0)
        mean = log(d * sum(self.magnitudes[j] for j in near) + 100)
        row = log(self.a) - log(self.b)
        return s, [
            32,
            log(fast + 16) - s,
            mean - self.usual[i] if near else 0,
            row,
            self.usual[i] - s if near else 0,
            log(self.means[number] + 16) - s,
            log(middle + 16) - s,
            log(self.g + 32) - log(self.h + 32) - row,
            log(4096 * most + 100) - mean,
        ]

    def read_value(self, number, i):
        s, x = self.inputs(number, i)
        self.weights[0] = self.bias[number]
        total = sum(one * other for one, other in zip(self.weights, x, strict=True))
        expected = clip(s + (total >> 16), 0, 383)
        value = 0
        if self.stream.adaptive(self.models.any[expected // 8]):
            value = self.read_magnitude(expected // 8)
            value = self.read_sign(i, value)
        m = self.magnitudes[i] = min(abs(value), 4095)
        if value or share(expected) > 4096:
            error = min(m * (65536 - share(expected)), 2**19) - share(expected)
            steps = [(error * one + 2048) >> 12 for one in x]
            self.weights = [signed(w + step) for w, step in zip(self.weights, steps, strict=True)]
            self.bias[number] = self.weights[0]
        self.note(number, m, self.sums[i][2])
        return value

    def read_magnitude(self, c):
        k = 1
        while k < 31 and self.stream.adaptive(self.models.longer[k, c]):
            k += 1
        if k == 1:
            return 1
        value, left = 2 + self.stream.adaptive(self.models.upper[k, c]), k - 2
        while left:
            n = min(left, 16)
            value = value << n | self.stream.raw(n)
            left -= n
        return value

    def read_sign(self, i, magnitude):
        signs = [(j, (self.values[j] > 0) - (self.values[j] < 0)) for j in self.near[i]]
        vote = sum(self.agreement[i, j] * sign for j, sign in signs)
        wrong = self.stream.adaptive(self.models.wrong[abs(vote).bit_length()])
        own = -1 if wrong != (vote < 0) else 1
        for j, sign in signs:
            if sign:
                self.agreement[i, j] += 16 * own * sign - (self.agreement[i, j] >> 3)
        return own * magnitude

    def note(self, number, m, slow):
        self.g += 256 * m - (self.g >> 2)
        self.h += (slow >> 4) - (self.h >> 2)
        self.a += 16 * m
        self.b += slow >> 8
        if max(self.a, self.b) >= 2**23:
            self.a, self.b = self.a >> 1 | 1, self.b >> 1 | 1
        self.means[number] += (4096 * m - self.means[number]) >> 4

    def end_row(self, row):
        for i, sums in self.sums.items():
            for n in range(3):
                sums[n] += (4096 * self.magnitudes[i] - sums[n]) >> (n + 1)
        for place, (i, near) in enumerate(self.near.items()):
            if row < 4 or place % 4 == row % 4:
                d = 4096 // len(near) if near else 0
                self.usual[i] = d * sum(log(self.sums[j][2] + 16) for j in near) >> 12


def decode_fields_plainly(data, n_rows, passes):
    """Rows of integers, lists of lists; `passes` as of `Reader`."""
    reader = Reader(data, passes)
    rows = []
    for row in range(n_rows):
        values = reader.read_row(row)
        rows.append([values[i] for i in range(len(values))])
    assert reader.stream.ends_well()
    return rows
