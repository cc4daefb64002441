import zlib

import numpy as np
import pytest

from conformance.fields import FieldReader
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.fields import MAX_MAGNITUDE, encode_fields
from samples.coded_fields import decode_fields
from samples.passes import as_order, line_passes, passes_of


def active_places(n_rows=20, n_columns=3000):
    """Return rows of falling energy, all active in the same smooth third of the columns."""
    rng = np.random.default_rng(5)
    activity = np.exp(3 * np.sin(np.arange(n_columns) / 40) - 2)
    scale = activity * 0.85 ** np.arange(n_rows)[:, None]
    return np.rint(rng.laplace(scale=scale)).astype(int)


SMALL = np.array(
    [
        [0, 1, -1, 0, 2, 40, -3, 0],
        [0] * 8,
        [1, -1, 0, 0, 1, 1000, 0, -7],
        [0, 0, -1, 0, 0, 300, 0, 0],
    ]
)
LONG = np.concatenate([SMALL, SMALL[::-1, ::-1], -SMALL, [[0] * 8, [3, 0, 0, -1, 9, 0, 0, 1]]])
"""More rows than are refreshed at the end of each row, some of them empty."""


@pytest.mark.parametrize("passes", [None, line_passes(500)])
@pytest.mark.parametrize(
    "fields",
    [
        np.zeros((0, 500), int),
        np.zeros((3, 500), int),
        np.full((3, 500), MAX_MAGNITUDE),
        np.full((2, 500), -MAX_MAGNITUDE),
        np.resize([0, 2**16, -(2**30), 1], (5, 500)),
        active_places(6, 500),
        active_places(6, 500)[::-1],
        np.full((13, 500), -MAX_MAGNITUDE),
        np.resize([0, 2**16, -(2**30), 1, 0], (16, 500)),
        active_places(7, 500)[::-1],
        active_places(20, 500)[::-1],
    ],
)
def test_unusual_fields_round_trip(fields, passes):
    data = encode_fields(fields, passes)
    np.testing.assert_array_equal(decode_fields(data, *fields.shape, passes=passes), fields)


def test_empty_passes_do_not_change_the_bytes():
    fields = active_places(6, 500)
    order = line_passes(500)
    nothing = [], []
    with_empty = as_order(nothing, *passes_of(order), nothing)
    assert encode_fields(fields, with_empty) == encode_fields(fields, order)


def test_zeros_take_few_bytes():
    data = encode_fields(np.zeros((10, 100_000), int), None)
    assert len(data) < 1000
    assert not decode_fields(data, 10, 100_000).any()


def test_encoding_raises_when_an_integer_is_too_large():
    with pytest.raises(InvalidInputError, match="magnitudes up to 2147483647"):
        encode_fields(np.array([[MAX_MAGNITUDE + 1]]), None)


def test_encoding_raises_unless_there_are_two_axes():
    with pytest.raises(InvalidInputError, match=r"got shape \(8,\)"):
        encode_fields(SMALL[0], None)


def test_decoding_raises_for_trailing_bytes():
    with pytest.raises(CorruptStreamError, match="fields are damaged"):
        decode_fields(encode_fields(SMALL) + bytes(8) + b"\1", *SMALL.shape)


@pytest.mark.parametrize(
    "passes",
    [
        as_order(),
        as_order((range(7), [[]] * 7)),
        as_order((range(8), [[]] * 8), ([3], [[]])),
        as_order((range(7), [[]] * 7), ([3], [[]])),
        as_order((range(7), [[]] * 7), ([8], [[]])),
        as_order((range(7), [[]] * 7), ([-1], [[]])),
        as_order((range(8), [[0], *[[]] * 7])),
        as_order((range(8), [[1], *[[]] * 7])),
        as_order((range(8), [*[[]] * 7, [8]])),
        as_order((range(8), [*[[]] * 7, [0] * 17])),
    ],
)
def test_passes_are_rejected_unless_they_permute_the_columns(passes):
    with pytest.raises(InvalidInputError, match=r"passes have|cannot be encoded"):
        encode_fields(SMALL, passes)
    if passes.n_columns == SMALL.shape[1]:
        with pytest.raises(InvalidInputError, match="cannot be encoded"):
            decode_fields(b"\1" * 100, *SMALL.shape, passes=passes)


def test_encoding_accepts_read_only_fields():
    fields = np.frombuffer(active_places(5, 60).astype(np.int32).tobytes(), np.int32).reshape(5, 60)
    np.testing.assert_array_equal(decode_fields(encode_fields(fields), 5, 60), fields)


@pytest.mark.parametrize("n_wanted", [1, 3, 39])
def test_first_rows_are_decoded_without_the_others(n_wanted):
    fields = active_places(40, 600)
    coded = encode_fields(fields)
    first = decode_fields(coded, 40, 600, n_wanted=n_wanted)
    np.testing.assert_array_equal(first, fields[:n_wanted])
    damaged = coded[:-12] + bytes(range(200, 212))
    if n_wanted < 39:
        np.testing.assert_array_equal(decode_fields(damaged, 40, 600, n_wanted=n_wanted), first)
    np.testing.assert_array_equal(decode_fields(coded, 40, 600, n_wanted=99), fields)


STORED = {
    "passes": "96451492cb129a83ae4ec204d559437e",
    "alone": "ba6314cb17b4f3ddbf17a2eb02a6b5d5",
    "long": "96451492cb129a83ae4ec204d559437df5cc20445a887c2daeb3768dbd110a3b"
    "a20607bf87c6da9b9ab7fce9d2e54a7460b07f3be493e55268f70bb9",
}


@pytest.mark.parametrize(
    ("name", "passes", "fields"),
    [("passes", line_passes(8), SMALL), ("alone", None, SMALL), ("long", line_passes(8), LONG)],
)
def test_bytes_equal_the_stored_ones(name, passes, fields):
    """The decoded values depend on every rule of the contexts."""
    assert encode_fields(fields, passes).hex() == STORED[name]
    decoded = decode_fields(bytes.fromhex(STORED[name]), *fields.shape, passes=passes)
    np.testing.assert_array_equal(decoded, fields)


def test_bytes_of_a_long_stream_equal_the_stored_ones():
    """Covers rules that apply after many integers: halved sums, adapted weights."""
    index = np.arange(20_000)
    fields = np.stack([(index * factor % 1009 < 90) * (index % 7 - 3) for factor in range(1, 16)])
    stored = encode_fields(fields, line_passes(20_000))
    assert (len(stored), zlib.crc32(stored)) == (11065, 150666320)


def grid_passes(side):
    """Return passes of a grid (every fourth, every second, the rest) and earlier neighbors."""
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


def lively_fields(scale, n_rows, n_columns=169):
    """Return the first of 16 rows of falling energy, some of them empty."""
    rng = np.random.default_rng(8)
    smooth = np.exp(np.sin(np.arange(n_columns) / 9)) * scale * 0.8 ** np.arange(16)[:, None]
    fields = np.rint(rng.laplace(scale=smooth) + smooth).astype(int)
    fields[[4, 9, 14]] = 0
    fields[[5, 10], ::2] = 0
    fields[6, :3] = (100, -5000, 2**31 - 1)
    return fields[:n_rows]


def assert_read_alike(fields, passes):
    order = as_order(*((list(near), list(near.values())) for near in passes))
    reader = FieldReader(encode_fields(fields, order), passes)
    for row, expected in enumerate(fields.tolist()):
        decoded = reader.read_row(row)
        assert [decoded[i] for i in range(len(expected))] == expected
    reader.stream.end()


@pytest.mark.parametrize("n_rows", [1, 4, 5, 16])
@pytest.mark.parametrize("scale", [0.2, 3.0])
def test_plain_reader_decodes_the_same_fields(scale, n_rows):
    passes = grid_passes(13)
    assert [len(near) for near in passes] == [16, 33, 0, 120]
    assert_read_alike(lively_fields(scale, n_rows), passes)


@pytest.mark.parametrize("n_rows", [1, 16])
@pytest.mark.parametrize("scale", [0.2, 3.0])
def test_plain_reader_decodes_the_same_fields_of_a_single_pass(scale, n_rows):
    assert_read_alike(lively_fields(scale, n_rows), [{i: [] for i in range(169)}])


def test_plain_reader_decodes_the_same_fields_with_neighbors_in_the_same_pass():
    passes = [{i: list(range(max(0, i - 16), i, 1 + i % 3)) for i in range(169)}]
    assert_read_alike(lively_fields(1.0, 12), passes)


@pytest.mark.slow
def test_plain_reader_decodes_the_same_long_rows():
    """Covers halved sums, the slowest adaptation, and distant weights."""
    fields = np.zeros((6, 3000), int)
    for number, row in enumerate(fields):
        row[number :: 5 + 40 * (number % 2)] = 1 - 2 * (number % 3 == 0)
    fields[4:] = np.random.default_rng(2).integers(-5000, 5000, (2, 3000))
    assert_read_alike(fields, [{i: [i - 1] * (i > 0) for i in range(3000)}])


def test_plain_reader_decodes_the_same_fields_of_jumping_magnitudes():
    """Covers the largest steps of weights, and magnitudes beyond the contexts."""
    rng = np.random.default_rng(3)
    jumps = rng.integers(0, 31, (12, 400)) * (rng.random((12, 400)) < 0.3)
    fields = np.where(jumps > 0, 2**jumps, 0) * rng.choice([-1, 1], (12, 400))
    assert_read_alike(fields, [{i: list(range(max(0, i - 4), i)) for i in range(400)}])
