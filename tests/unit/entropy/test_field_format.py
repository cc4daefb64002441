"""A second decoder of fields, slow, scalar and written from the words of `docs/format.md`."""

from itertools import pairwise

import constriction
import numpy as np
import pytest

from meshreel.entropy.field_coder import encode_fields
from meshreel.entropy.varint import read_varint
from samples.passes import as_pass

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
        for context in set(contexts):
            if self.total[context] > 128 * 1024:
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
        self.upper = Table([65536 * p // (65536 + p) for power in powers for p in power])
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
        here = [i for i, length in enumerate(lengths) if length >= 2]
        bits = self.upper.read(coder, [72 * (lengths[i] - 2) + known[i][0] for i in here])
        for i, bit in zip(here, bits, strict=True):
            values[i] = (2 + bit) << (lengths[i] - 2)
        self.read_signs(coder, values, [vote for *_, vote in known])
        return values

    def read_signs(self, coder, values, votes):
        used = [i for i, value in enumerate(values) if value]
        contexts = [sum(bound <= abs(votes[i]) for bound in SIGN_BOUNDS) for i in used]
        for i, bit in zip(used, self.sign.read(coder, contexts), strict=True):
            if bit != (votes[i] < 0):
                values[i] = -values[i]


def batches(n_rows):
    """First row of each batch, and the row behind it."""
    return pairwise([*range(min(n_rows, 6)), *range(6, n_rows, 6), n_rows])


def decode_slowly(data, n_rows, n_columns, passes):
    """Coarse integers of a payload, and the mean classes of each batch, pass and row.

    Of each pass, `passes` has the neighbours of each of its columns.
    """
    n_words, start = read_varint(data, 0)
    words = np.frombuffer(data, "<u4", n_words, start).astype(np.uint32)
    coder = constriction.stream.stack.AnsCoder(words)
    passes = [near for near in passes if near]
    agreement = {(i, j): 1 for near in passes for i in near for j in near[i]}
    past, past_mean = [0] * n_columns, [0] * n_columns
    before = [40] * len(passes)
    tables, tables_of_classes = Tables(), Tables()
    rows = [[0] * n_columns for _ in range(n_rows)]
    all_classes = []
    for first, end in batches(n_rows):
        length = end - first
        changes = tables_of_classes.read(coder, [(41, 0, 0, 0)] * (len(passes) * length))
        classes = [
            [before[place] + changes[place * length + r] for r in range(length)]
            for place in range(len(passes))
        ]
        assert all(0 <= one_class <= 70 for one in classes for one_class in one)
        batch, means = rows[first:end], [[0] * n_columns for _ in range(length)]

        def known_of(i, near, row, mean):
            near_sum = sum(min(abs(row[j]), 65535) for j in near)
            seen = ONE // 3 + past[i] // 2 + ONE * near_sum
            usual = ONE // 3 + past_mean[i] // 2 + sum(mean[j] for j in near)
            return (
                clamp((log(mean[i]) + log(seen) - log(usual)) // 4, 0, 71),
                sum(bound <= past[i] for bound in PAST_BOUNDS),
                min(near_sum, 2),
                sum(agreement[i, j] * clamp(row[j], -2, 2) for j in near),
            )

        for near, classes_here in zip(passes, classes, strict=True):
            places = [(i, r) for i in near for r, one_class in enumerate(classes_here) if one_class]
            for i, r in places:
                means[r][i] = mean_of(classes_here[r])
            known = [known_of(i, near[i], batch[r], means[r]) for i, r in places]
            read = tables.read(coder, known) if known else []
            for (i, r), value in zip(places, read, strict=True):
                batch[r][i] = value
        for row, mean in zip(batch, means, strict=True):
            for i, value in enumerate(row):
                past[i] += ONE * min(abs(value), 65535) - past[i] // 8
                past_mean[i] += mean[i] - past_mean[i] // 8
            for i, j in agreement:
                agreement[i, j] += clamp(row[i], -2, 2) * clamp(row[j], -2, 2)
        before = [one[-1] for one in classes]
        all_classes.append(classes)
    assert coder.is_empty()
    return np.array(rows), all_classes


def grid_passes(side):
    """Columns of a square grid: every fourth, every second, the rest; near are earlier ones."""
    place = {(x, y): y * side + x for y in range(side) for x in range(side)}
    passes = []
    for is_here in (
        lambda x, y: x % 4 == y % 4 == 0,
        lambda x, y: x % 2 == y % 2 == 0,
        lambda x, y: False,
        lambda x, y: True,
    ):
        known = {i for near in passes for i in near}
        passes.append({})
        for (x, y), i in place.items():
            if is_here(x, y) and i not in known:
                around = [place.get((x + a, y + b)) for a in (-2, -1, 0, 1, 2) for b in (-1, 0, 2)]
                passes[-1][i] = [j for j in around if j in known]
    return passes


def as_arrays(passes):
    return [as_pass(list(near), list(near.values())) for near in passes]


def lively_fields(scale, n_rows, n_columns=169):
    """Of 16 rows in falling energy, some of them empty, the first ones."""
    rng = np.random.default_rng(8)
    smooth = np.exp(np.sin(np.arange(n_columns) / 9)) * scale * 0.8 ** np.arange(16)[:, None]
    fields = np.rint(rng.laplace(scale=smooth) + smooth).astype(int)
    fields[[4, 9, 14]] = 0
    fields[[5, 10], ::2] = 0
    fields[6, :3] = (100, -5000, 2**31 - 1)
    return fields[:n_rows]


def fields_with_empty_passes(passes):
    """Four empty rows turn mean classes to 0, so that those of the batch after may be 0 as well."""
    n_columns = sum(map(len, passes))
    fields = np.rint(np.random.default_rng(9).laplace(scale=2.0, size=(21, n_columns))).astype(int)
    fields[[2, 3, 4, 5, 7, 10, 11, 12, 14, 19]] = 0
    fields[12:18, list(passes[1])] = 0
    fields[9, list(passes[0])] = 0
    return fields


def assert_read_alike(fields, passes, arrays):
    """The mean classes that the second decoder saw."""
    decoded, classes = decode_slowly(encode_fields(fields, arrays), *fields.shape, passes=passes)
    size = np.maximum(np.frexp(np.abs(fields))[1] - 2, 0)
    np.testing.assert_array_equal(np.abs(decoded), np.abs(fields) >> size << size)
    np.testing.assert_array_equal(np.sign(decoded), np.sign(fields))
    return classes


LENGTHS = [1, 5, 6, 7, 11, 12, 13, 16]


@pytest.mark.parametrize("n_rows", LENGTHS)
@pytest.mark.parametrize("scale", [0.2, 3.0])
def test_payload_is_read_alike_when_a_second_decoder_follows_the_format(scale, n_rows):
    passes = grid_passes(13)
    assert [len(near) for near in passes] == [16, 33, 0, 120]
    assert_read_alike(lively_fields(scale, n_rows), passes, as_arrays(passes))


@pytest.mark.parametrize("n_rows", LENGTHS)
@pytest.mark.parametrize("scale", [0.2, 3.0])
def test_payload_is_read_alike_when_there_is_a_single_pass(scale, n_rows):
    assert_read_alike(lively_fields(scale, n_rows), [{i: [] for i in range(169)}], None)


def test_payload_is_read_alike_when_passes_are_empty_in_some_rows_of_a_batch_or_in_all():
    passes = grid_passes(13)
    classes = assert_read_alike(fields_with_empty_passes(passes), passes, as_arrays(passes))
    assert [len(batch[0]) for batch in classes] == [1, 1, 1, 1, 1, 1, 6, 6, 3]
    is_empty = [[[one_class == 0 for one_class in one] for one in batch] for batch in classes]
    assert is_empty[6] == [
        [False, True, False, True, True, True],
        [False, True, False, False, True, True],
        [False, True, False, False, True, True],
    ]
    assert is_empty[7][0] == is_empty[7][2] == [True, False, True, False, False, False]
    assert all(is_empty[7][1])


def test_payload_is_read_alike_when_counts_are_halved():
    """Sets so large that counts of a context are halved and still exceed the limit."""
    fields = np.zeros((15, 700), int)
    for number, row in enumerate(fields):
        row[number :: 5 + 40 * (number % 2)] = 1 - 2 * (number % 3 == 0)
    assert_read_alike(fields, [{i: [] for i in range(700)}], None)
