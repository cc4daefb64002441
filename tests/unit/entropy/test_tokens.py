import numpy as np
import pytest

from meshreel.entropy.tokens import (
    MAX_MAGNITUDE,
    N_TOKENS,
    TOKEN_WIDTHS,
    join_integers,
    split_integers,
)
from meshreel.errors import InvalidInputError


def test_tokens_are_direct_when_magnitudes_are_below_sixteen():
    tokens, _ = split_integers(np.array([0, 1, -1, 2, -2, 15, -15]))
    assert tokens.tolist() == [0, 1, 2, 3, 4, 29, 30]


def test_every_value_comes_back_when_it_lies_at_a_boundary():
    powers = 2 ** np.arange(31)
    values = np.concatenate([powers, powers - 1, powers + 1, [MAX_MAGNITUDE]])
    values = np.concatenate([values, -values])
    tokens, raw = split_integers(values)
    np.testing.assert_array_equal(join_integers(tokens, raw), values)
    assert tokens.max() == N_TOKENS - 1
    assert (raw < 2 ** TOKEN_WIDTHS[tokens]).all()


def test_split_refuses_when_a_magnitude_is_too_large():
    with pytest.raises(InvalidInputError, match="up to 2147483647 can be coded; got 2147483648"):
        split_integers(np.array([-(2**31)]))
