import zlib

import numpy as np
import pytest

from meshreel.entropy.adaptive import BitWriter
from meshreel.entropy.coder import encode_integers
from meshreel.entropy.contexts import Contexts
from meshreel.entropy.field_coder import FIRST_MEAN_CLASS, decode_fields, encode_fields
from meshreel.entropy.tokens import MAX_MAGNITUDE
from meshreel.entropy.value_model import ValueModel
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError, InvalidInputError
from samples.passes import as_pass, line_passes


def active_places(n_rows=20, n_columns=3000):
    """Rows of falling energy; in each the same smooth third of the columns is active."""
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
"""Rows alone, a batch with empty rows in it, and a batch of two."""


def test_size_is_far_below_that_of_tables_when_activity_has_a_place():
    fields = active_places()
    alone = len(encode_fields(fields, None))
    assert (
        len(encode_fields(fields, line_passes(3000)))
        < alone
        < 0.85 * len(encode_integers(list(fields)))
    )


def test_signs_cost_little_when_neighbours_always_agree():
    rng = np.random.default_rng(6)
    signs = np.repeat(rng.choice([-1, 1], (40, 50)), 20, axis=1)
    bits = 8 * len(encode_fields(signs, line_passes(1000)))
    assert bits < 0.3 * signs.size


def test_signs_cost_little_when_neighbours_always_disagree():
    rng = np.random.default_rng(6)
    signs = np.repeat(rng.choice([-1, 1], (40, 50)), 20, axis=1)
    signs[:, ::2] *= -1
    bits = 8 * len(encode_fields(signs, line_passes(1000)))
    assert bits < 0.4 * signs.size


def test_bytes_are_the_same_when_coded_twice():
    fields = active_places()
    assert encode_fields(fields, line_passes(3000)) == encode_fields(fields, line_passes(3000))


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
def test_fields_come_back_when_they_are_unusual(fields, passes):
    data = encode_fields(fields, passes)
    np.testing.assert_array_equal(decode_fields(data, *fields.shape, passes=passes), fields)


@pytest.mark.parametrize("shape", [(0, 0), (0, 4), (4, 0), (1, 1)])
def test_fields_come_back_when_there_is_little_in_them(shape):
    data = encode_fields(np.zeros(shape, np.int8), None)
    assert decode_fields(data, *shape, passes=None).shape == shape


@pytest.mark.parametrize("passes", [None, line_passes(40)])
def test_mean_classes_are_kept_above_zero_when_rows_alternate_with_empty_ones(passes):
    fields = np.zeros((60, 40), int)
    fields[::2] = np.arange(30)[:, None] ** 4
    data = encode_fields(fields, passes)
    np.testing.assert_array_equal(decode_fields(data, 60, 40, passes), fields)


def test_fields_come_back_when_some_passes_are_empty_and_others_are_not():
    """An empty pass costs its mean class only, and adds nothing to its neighbours."""
    fields = active_places(20, 500)
    fields[::3, ::2] = 0
    fields[1::3, 1::2] = 0
    data = encode_fields(fields, line_passes(500))
    np.testing.assert_array_equal(decode_fields(data, 20, 500, line_passes(500)), fields)


@pytest.mark.parametrize("n_rows", range(1, 20))
def test_first_rows_come_back_alike_when_the_last_batch_is_of_any_length(n_rows):
    fields = active_places(n_rows, 60)
    fields[8::3] = 0
    passes = line_passes(60)
    data = encode_fields(fields, passes)
    np.testing.assert_array_equal(decode_fields(data, n_rows, 60, passes), fields)


def test_bytes_are_fewer_when_columns_of_different_magnitude_are_passes_of_their_own():
    """A single row: only the pass gives a context."""
    rng = np.random.default_rng(12)
    large = rng.permutation(3000) < 300
    fields = np.rint(rng.laplace(scale=np.where(large, 60.0, 0.2))).astype(int)[None]
    apart = [
        as_pass(columns, [[]] * len(columns))
        for columns in (np.flatnonzero(large), np.flatnonzero(~large))
    ]
    assert len(encode_fields(fields, apart)) < 0.5 * len(encode_fields(fields))


def test_bytes_are_fewer_when_neighbours_show_where_a_row_is_active():
    """A single row, active on a third of a line, in passes that do not know where."""
    place = np.arange(3000)
    rng = np.random.default_rng(13)
    scale = np.where((place > 1000) & (place < 2000), 3.0, 0.01)
    fields = np.rint(rng.laplace(scale=scale)).astype(int)[None]
    alone = [as_pass(one.columns, [[]] * len(one.columns)) for one in line_passes(3000)]
    assert len(encode_fields(fields, line_passes(3000))) < 0.85 * len(encode_fields(fields, alone))


def test_bytes_stay_the_same_when_passes_without_columns_are_named():
    fields = active_places(6, 500)
    passes = line_passes(500)
    nothing = as_pass([], [])
    assert encode_fields(fields, [nothing, *passes, nothing]) == encode_fields(fields, passes)


def test_writer_pads_when_nearly_nothing_is_coded():
    assert len(encode_fields(np.zeros((10, 100_000), int), None)) == -(-10 * 100_000 // 256)
    assert len(encode_fields(np.zeros((1000, 2), int), None)) == 1000


@pytest.mark.parametrize("shape", [(10**9, 1), (1, 10**12), (10**9, 0)])
def test_more_integers_are_refused_when_the_bytes_cannot_hold_them(shape):
    with pytest.raises(CorruptStreamError, match="cannot hold"):
        decode_fields(encode_fields(SMALL, None), *shape, passes=None)


def test_encoding_refuses_when_an_integer_is_too_large():
    with pytest.raises(InvalidInputError, match="magnitudes up to 2147483647"):
        encode_fields(np.array([[MAX_MAGNITUDE + 1]]), None)


def test_encoding_refuses_when_there_are_not_two_axes():
    with pytest.raises(InvalidInputError, match=r"got shape \(8,\)"):
        encode_fields(SMALL[0], None)


def test_decoding_raises_when_bytes_are_left_over():
    with pytest.raises(CorruptStreamError, match="should end at byte"):
        decode_fields(encode_fields(SMALL, None) + b"\0", *SMALL.shape, passes=None)


@pytest.mark.parametrize("change", [-48, 32])
def test_decoding_raises_when_a_mean_class_leaves_its_range(change):
    port, nothing = BitWriter(), np.zeros(1, np.int64)
    contexts = Contexts(np.array([FIRST_MEAN_CLASS + 1]), nothing, nothing, nothing)
    ValueModel().code(port, np.array([change]), contexts)
    words = port.words()
    with pytest.raises(
        CorruptStreamError, match=rf"mean classes \[\[{FIRST_MEAN_CLASS + change}\]\]"
    ):
        decode_fields(write_varint(len(words) // 4) + words, 1, 8)


def test_decoding_raises_when_the_data_end_early():
    data = encode_fields(active_places(), None)
    for size in (0, 300, len(data) // 2, len(data) - 1):
        with pytest.raises(CorruptStreamError):
            decode_fields(data[:size], 20, 3000, None)


@pytest.mark.parametrize(
    ("stored", "passes", "fields"),
    [
        (
            "08f98df008604fea94a0d03837bd87ecef2044523b853af060117aa913a96f1832889e05",
            line_passes(8),
            SMALL,
        ),
        (
            "0639bc0418df89fdf37711ffdd39da995f830762dc30423a67889e05",
            None,
            SMALL,
        ),
        (
            "15ef7f5d612a901e568d1da722821c40d45fa4832a4e6c704e304a5a01271395054393e6c2a3d08b"
            "a75302ce20b3e9544faba50369b0bd27e9901d4c9efb12e0e2adcdf7989c48d534921315024fa1b8"
            "a4e559f910889ec58a8e889e15",
            line_passes(8),
            LONG,
        ),
    ],
)
def test_stored_bytes_still_decode_when_libraries_change(stored, passes, fields):
    """The parse hangs on every rule of the contexts, and on how constriction rounds."""
    decoded = decode_fields(bytes.fromhex(stored), *fields.shape, passes=passes)
    np.testing.assert_array_equal(decoded, fields)


def test_a_long_stream_still_is_the_same_when_libraries_change():
    """Rules that only show after many integers: halved counts, rare classes."""
    index = np.arange(20_000)
    fields = np.stack([(index * factor % 1009 < 90) * (index % 7 - 3) for factor in range(1, 16)])
    stored = encode_fields(fields, line_passes(20_000))
    assert (len(stored), zlib.crc32(stored)) == (14318, 570126684)
