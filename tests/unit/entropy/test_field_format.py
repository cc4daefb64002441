"""A second decoder of fields, slow, scalar and written from the words of `docs/format.md`."""

import constriction
import numpy as np
import pytest

from meshreel.entropy.field_coder import encode_fields
from meshreel.entropy.varint import read_varint

BERNOULLI = constriction.stream.model.Bernoulli(perfect=False)
ONE = 2**20
PAST_BOUNDS = [bound * (ONE // 5) for bound in (2, 5, 9, 15, 24)]
SIGN_BOUNDS = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64]


def mean_of(half_octave):
    return (5 + 2 * (half_octave % 2)) * 2 ** (half_octave // 2) // 4


def log(number):
    octave = number.bit_length() - 1
    return 8 * octave + (8 * number >> octave) - 8


def clamp(number, low, high):
    return max(low, min(high, number))


class Table:
    def __init__(self, guesses):
        self.total = [12 * 1024] * len(guesses)
        self.ones = [clamp(guess, 16, 65520) * 12 * 1024 // 65536 for guess in guesses]

    def read(self, coder, contexts):
        if not contexts:
            return []
        shares = [clamp(65536 * self.ones[c] // self.total[c], 16, 65520) for c in contexts]
        bits = [read_bit(coder, share) for share in shares]
        for context, bit in zip(contexts, bits, strict=True):
            self.total[context] += 1024
            self.ones[context] += 1024 * bit
        for context, total in enumerate(self.total):
            if total > 128 * 1024:
                self.total[context] //= 2
                self.ones[context] //= 2
        return bits


def read_bit(coder, share):
    return int(coder.decode(BERNOULLI, np.array([share / 65536]))[0])


class Tables:
    def __init__(self):
        powers = [[65536 * mean_of(i) // (mean_of(i) + ONE) for i in range(72)]]
        for _ in range(29):
            powers.append([power * power // 65536 for power in powers[-1]])
        self.longer = [Table(np.repeat(powers[0], 18).tolist()), *map(Table, powers)]
        self.upper = [Table([65536 * p // (65536 + p) for p in power]) for power in powers]
        self.sign = Table([32768] * 13)

    def read(self, coder, known):
        """Coarse integers, of which (expected, past, near, vote) are known."""
        lengths = [0] * len(known)
        left = list(range(len(known)))
        for k in range(31):
            contexts = [known[i][0] for i in left]
            if k == 0:
                contexts = [(x * 6 + past) * 3 + near for x, past, near, _ in known]
            bits = self.longer[k].read(coder, contexts)
            left = [i for i, bit in zip(left, bits, strict=True) if bit]
            for i in left:
                lengths[i] = k + 1
            if not left:
                break
        values = [min(length, 1) for length in lengths]
        for length in range(2, max(lengths) + 1):
            here = [i for i, other in enumerate(lengths) if other == length]
            bits = self.upper[length - 2].read(coder, [known[i][0] for i in here])
            for i, bit in zip(here, bits, strict=True):
                values[i] = (2 + bit) << (length - 2)
        self.read_signs(coder, values, [vote for *_, vote in known])
        return values

    def read_signs(self, coder, values, votes):
        used = [i for i, value in enumerate(values) if value]
        for i in used:
            if votes[i] == 0 and read_bit(coder, 32768):
                values[i] = -values[i]
        used = [i for i in used if votes[i]]
        contexts = [sum(bound <= abs(votes[i]) for bound in SIGN_BOUNDS) for i in used]
        for i, bit in zip(used, self.sign.read(coder, contexts), strict=True):
            if bit != (votes[i] < 0):
                values[i] = -values[i]


def pass_numbers(near):
    priority = [1 + i * 2654435761 % 2**32 for i in range(len(near))]
    numbers = [3] * len(near)
    for k in range(3):
        candidates = {i for i, number in enumerate(numbers) if number == 3}
        for _ in range(12):
            chosen = {
                i
                for i in candidates
                if all(priority[i] > priority[j] for j in candidates & near[i])
            }
            for i in chosen:
                numbers[i] = k
            candidates = {i for i in candidates - chosen if not near[i] & chosen}
    return numbers


def decode_slowly(data, n_rows, n_columns, near):
    """Coarse integers of a payload; `near` has the set of neighbours of each column."""
    n_words, start = read_varint(data, 0)
    words = np.frombuffer(data, "<u4", n_words, start).astype(np.uint32)
    coder = constriction.stream.stack.AnsCoder(words)
    numbers = pass_numbers(near)
    coded = [{j for j in near[i] if numbers[j] < numbers[i]} for i in range(n_columns)]
    agreement = {(i, j): 1 for i in range(n_columns) for j in coded[i]}
    past, past_mean, scale = [0] * n_columns, 0, 40
    tables, tables_of_scales = Tables(), Tables()
    rows = np.zeros((n_rows, n_columns), np.int64)
    for values in rows:
        scale += tables_of_scales.read(coder, [(41, 0, 0, 0)])[0]
        if scale == 0:
            continue
        row, mean = [0] * n_columns, mean_of(scale)

        def known_of(i, row=row, mean=mean, past_mean=past_mean):
            near_sum = sum(min(abs(row[j]), 65535) for j in coded[i])
            seen = ONE // 3 + past[i] // 2 + ONE * near_sum
            usual = ONE // 3 + past_mean // 2 + mean * len(coded[i])
            return (
                clamp((log(mean) + log(seen) - log(usual)) // 4, 0, 71),
                sum(bound <= past[i] for bound in PAST_BOUNDS),
                min(near_sum, 2),
                sum(agreement[i, j] * clamp(row[j], -2, 2) for j in coded[i]),
            )

        for k in range(4):
            columns = [i for i, number in enumerate(numbers) if number == k]
            if columns:
                read = tables.read(coder, [known_of(i) for i in columns])
                for i, value in zip(columns, read, strict=True):
                    row[i] = value
        for i, value in enumerate(row):
            past[i] += ONE * min(abs(value), 65535) - past[i] // 8
        past_mean += mean - past_mean // 8
        for i, j in agreement:
            agreement[i, j] += clamp(row[i], -2, 2) * clamp(row[j], -2, 2)
        values[:] = row
    assert coder.is_empty()
    return rows


def grid_neighbours(side):
    return [
        {
            (y + b) * side + x + a
            for a, b in [(1, 0), (0, 1), (1, 1), (-1, 0), (0, -1), (-1, -1)]
            if 0 <= x + a < side and 0 <= y + b < side
        }
        for y in range(side)
        for x in range(side)
    ]


@pytest.mark.parametrize("has_neighbours", [True, False])
@pytest.mark.parametrize("scale", [0.2, 3.0])
def test_payload_is_read_alike_when_a_second_decoder_follows_the_format(has_neighbours, scale):
    near = grid_neighbours(13) if has_neighbours else [set() for _ in range(169)]
    rng = np.random.default_rng(8)
    smooth = np.exp(np.sin(np.arange(169) / 9)) * scale * 0.8 ** np.arange(10)[:, None]
    fields = np.rint(rng.laplace(scale=smooth) + smooth).astype(int)
    fields[4] = 0
    fields[6, :3] = (100, -5000, 2**31 - 1)
    counts = np.cumsum([0] + [len(one) for one in near])
    arrays = (counts, np.array([j for one in near for j in sorted(one)], np.int64))
    data = encode_fields(fields, arrays if has_neighbours else None)
    decoded = decode_slowly(data, *fields.shape, near)
    size = np.maximum(np.frexp(np.abs(fields))[1] - 2, 0)
    np.testing.assert_array_equal(np.abs(decoded), np.abs(fields) >> size << size)
    np.testing.assert_array_equal(np.sign(decoded), np.sign(fields))
