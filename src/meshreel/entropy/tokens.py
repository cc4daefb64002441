"""Integers of any size as small tokens and raw bits.

Magnitudes below 16 are one token for each value and sign. A larger magnitude is a token for its
octave and the half of the octave it lies in; sign and remaining bits follow raw. This is the
usual split of a long-tailed distribution into modelled bits and noise.
"""

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError

Integers = npt.NDArray[np.int64]

N_DIRECT = 31  # tokens of the values -15..15, in the order 0, 1, -1, 2, -2, ...
FIRST_OCTAVE = 4  # the first octave that is split into halves: magnitudes 16..31
LAST_OCTAVE = 30
N_TOKENS = N_DIRECT + 2 * (LAST_OCTAVE - FIRST_OCTAVE + 1)
MAX_MAGNITUDE = (1 << (LAST_OCTAVE + 1)) - 1


def _token_widths() -> Integers:
    octaves = np.repeat(np.arange(FIRST_OCTAVE, LAST_OCTAVE + 1), 2)
    return np.concatenate([np.zeros(N_DIRECT, np.int64), octaves])


TOKEN_WIDTHS = _token_widths()
"""Raw bits that follow each token: a sign and octave - 1 mantissa bits, or nothing."""


def split_integers(values: Integers) -> tuple[Integers, Integers]:
    """Tokens in 0..N_TOKENS-1 and the raw bits of each value (`TOKEN_WIDTHS` of them).

    Raises
    ------
    InvalidInputError
        If a magnitude exceeds `MAX_MAGNITUDE`.
    """
    magnitude = np.abs(values)
    if magnitude.size and magnitude.max() > MAX_MAGNITUDE:
        raise InvalidInputError(
            f"integers up to {MAX_MAGNITUDE} can be coded; got {magnitude.max()}; "
            "use fewer bits or a larger quantisation step"
        )
    negative = (values < 0).astype(np.int64)
    tokens = 2 * magnitude - (values > 0)
    raw = np.zeros_like(magnitude)
    large = np.flatnonzero(magnitude >= 1 << FIRST_OCTAVE)
    size = magnitude[large]
    # frexp is exact on integers below 2^53.
    octave = np.frexp(size.astype(np.float64))[1].astype(np.int64) - 1
    half = (size >> (octave - 1)) & 1
    mantissa = size & ((np.int64(1) << (octave - 1)) - 1)
    tokens[large] = N_DIRECT + 2 * (octave - FIRST_OCTAVE) + half
    raw[large] = 2 * mantissa + negative[large]
    return tokens, raw


def join_integers(tokens: Integers, raw: Integers) -> Integers:
    """The values whose tokens and raw bits `split_integers` returned."""
    magnitude = (tokens + 1) >> 1
    negative = (tokens & 1) == 0
    large = np.flatnonzero(tokens >= N_DIRECT)
    index = tokens[large] - N_DIRECT
    octave = (index >> 1) + FIRST_OCTAVE
    magnitude[large] = ((2 + (index & 1)) << (octave - 1)) + (raw[large] >> 1)
    negative[large] = (raw[large] & 1) == 1
    return np.where(negative, -magnitude, magnitude)
