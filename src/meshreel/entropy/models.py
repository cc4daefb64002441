"""Probability tables of integer frequencies, and their compact description.

A frequency is one of the levels 0, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, ... (two bits of mantissa),
so that a table is a row of small level numbers. Rounding a frequency to a level costs less than
0.01 bit per symbol. Tables are computed in integers only.
"""

import numpy as np
import numpy.typing as npt

from meshreel.entropy.deflate import deflate, inflate
from meshreel.entropy.tokens import N_TOKENS
from meshreel.errors import CorruptStreamError

Integers = npt.NDArray[np.int64]

N_LEVELS = 68  # level 0 is "never"; the largest frequency is 7 << 16


def _level_frequencies() -> Integers:
    index = np.arange(N_LEVELS - 1)
    return np.concatenate([[0], (4 + (index & 3)) << (index >> 2)]).astype(np.int64)


LEVEL_FREQUENCIES = _level_frequencies()


def table_levels(counts: Integers) -> Integers:
    """Level of each token's frequency, from its count.

    Parameters
    ----------
    counts : integer array of shape (n_tables, N_TOKENS)

    Returns
    -------
    Integer array of the same shape, in 0..N_LEVELS-1; 0 exactly where the count is 0.
    """
    top = np.maximum(counts.max(axis=1, keepdims=True), 1)
    scaled = (counts * LEVEL_FREQUENCIES[-1]) // top
    # The nearest level: boundaries halfway between two levels.
    bounds = (LEVEL_FREQUENCIES[1:-1] + LEVEL_FREQUENCIES[2:] + 1) // 2
    levels = 1 + np.searchsorted(bounds, scaled, side="right")
    return np.where(counts > 0, levels, 0)


def write_tables(levels: Integers) -> bytes:
    """Bytes of all tables: differences from the table before, deflated."""
    differences = np.diff(levels, axis=0, prepend=0)
    return deflate(differences.astype(np.int8).tobytes())


def read_tables(data: bytes, n_tables: int) -> Integers:
    """Levels of the tables that `write_tables` wrote, of shape (n_tables, N_TOKENS).

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of `n_tables` tables.
    """
    raw = inflate(data, n_tables * N_TOKENS, "probability tables")
    levels = np.cumsum(np.frombuffer(raw, np.int8).reshape(n_tables, N_TOKENS).astype(int), axis=0)
    if levels.size and (levels.min() < 0 or levels.max() >= N_LEVELS):
        raise CorruptStreamError(f"a frequency level lies outside 0..{N_LEVELS - 1}")
    return levels
