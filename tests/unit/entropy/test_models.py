import numpy as np
import pytest

from meshreel.entropy.models import LEVEL_FREQUENCIES, read_tables, table_levels, write_tables
from meshreel.entropy.tokens import N_TOKENS
from meshreel.errors import CorruptStreamError


def counts_of(*values):
    counts = np.zeros((1, N_TOKENS), np.int64)
    counts[0, : len(values)] = values
    return counts


def test_levels_are_zero_only_where_a_token_never_occurs():
    levels = table_levels(counts_of(10_000_000, 1, 0, 5))
    assert (levels[0, :4] > 0).tolist() == [True, True, False, True]


def test_rounding_to_levels_costs_little_when_counts_are_geometric():
    counts = counts_of(*np.geomspace(1e6, 10, 40).astype(int))[0]
    rounded = LEVEL_FREQUENCIES[table_levels(counts[None])[0]]
    share, modelled = counts / counts.sum(), rounded / rounded.sum()
    used = counts > 0
    extra_bits = np.sum(share[used] * np.log2(share[used] / modelled[used]))
    assert extra_bits < 0.01


def test_tables_come_back_when_written():
    levels = np.random.default_rng(0).integers(0, len(LEVEL_FREQUENCIES), (5, N_TOKENS))
    np.testing.assert_array_equal(read_tables(write_tables(levels), 5), levels)


@pytest.mark.parametrize("data", [b"", b"\xff\xff", write_tables(np.zeros((2, N_TOKENS), int))])
def test_reading_raises_when_the_bytes_are_not_of_that_many_tables(data):
    with pytest.raises(CorruptStreamError):
        read_tables(data, 3)


def test_reading_raises_when_a_level_is_out_of_range():
    levels = np.full((1, N_TOKENS), len(LEVEL_FREQUENCIES))
    with pytest.raises(CorruptStreamError, match="outside"):
        read_tables(write_tables(levels), 1)
