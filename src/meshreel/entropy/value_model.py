"""A model of integers as adaptive bits: length in unary, second highest bit, sign.

Lower bits of a magnitude are noise that no context predicts. They are left out here (`coarse`)
and stored raw.
"""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from meshreel.entropy.adaptive import (
    CERTAIN,
    PROBABILITY_BITS,
    AdaptiveBits,
    BitPort,
    Bits,
)
from meshreel.entropy.contexts import N_EXPECTED, N_NEAR, N_PAST, UNIT, Contexts, mean_of_class
from meshreel.entropy.tokens import MAX_MAGNITUDE

Integers = npt.NDArray[np.int64]

MAX_LENGTH = MAX_MAGNITUDE.bit_length()
SIGN_BOUNDS = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64])
SIGN_CLASSES = np.searchsorted(SIGN_BOUNDS, np.arange(SIGN_BOUNDS[-1] + 1), side="right")
"""Class of every magnitude of a predicted sign up to the last bound."""


class ValueModel:
    """Adaptive model of coarse integers, each coded in its contexts."""

    def __init__(self) -> None:
        powers = _powers_of_decay()
        non_zero = np.repeat(powers[0], N_PAST * N_NEAR)
        self._longer = [AdaptiveBits(guess) for guess in [non_zero, *powers[: MAX_LENGTH - 1]]]
        self._upper = AdaptiveBits(
            np.concatenate([CERTAIN * power // (CERTAIN + power) for power in powers])
        )
        self._wrong_sign = AdaptiveBits(np.full(len(SIGN_BOUNDS) + 1, CERTAIN // 2))

    def code(self, port: BitPort, truth: Integers | None, contexts: Contexts) -> Integers:
        """Coarse integers of shape (n,), written or read.

        Parameters
        ----------
        port : BitPort
        truth : integer array of shape (n,), or None
            The integers, coarse, if they are to be written.
        contexts : Contexts of n integers
        """
        magnitudes = None if truth is None else np.abs(truth)
        lengths = self._code_lengths(port, magnitudes, contexts)
        values = self._code_upper_halves(port, magnitudes, lengths, contexts.expected)
        (used,) = lengths.nonzero()
        negative = None if truth is None else truth[used] < 0
        values[used] *= self._code_signs(port, negative, contexts.prediction[used])
        return values

    def _code_lengths(
        self, port: BitPort, magnitudes: Integers | None, contexts: Contexts
    ) -> Integers:
        true_lengths = None if magnitudes is None else bit_lengths(magnitudes)
        lengths = np.zeros(len(contexts.expected), np.int64)
        open_ones = np.arange(len(lengths))
        classes = (contexts.expected * N_PAST + contexts.past) * N_NEAR + contexts.near
        for length, bits in enumerate(self._longer):
            truth = None if true_lengths is None else true_lengths > length
            (longer,) = bits.code(port, truth, classes).nonzero()
            if not len(longer):
                break
            open_ones = open_ones[longer]
            lengths[open_ones] = length + 1
            classes = contexts.expected[open_ones]
            if true_lengths is not None:
                true_lengths = true_lengths[longer]
        return lengths

    def _code_upper_halves(
        self, port: BitPort, magnitudes: Integers | None, lengths: Integers, expected: Integers
    ) -> Integers:
        values = np.minimum(lengths, 1)
        (here,) = (lengths > 1).nonzero()
        shifts = lengths[here] - 2
        truth = None if magnitudes is None else (magnitudes[here] >> shifts & 1) == 1
        upper = self._upper.code(port, truth, shifts * N_EXPECTED + expected[here])
        values[here] = (2 + upper.astype(np.int64)) << shifts
        return values

    def _code_signs(self, port: BitPort, negative: Bits | None, prediction: Integers) -> Integers:
        expected = prediction < 0
        classes = SIGN_CLASSES[np.minimum(np.abs(prediction), SIGN_BOUNDS[-1])]
        truth = None if negative is None else negative ^ expected
        wrong = self._wrong_sign.code(port, truth, classes)
        return 1 - 2 * (wrong ^ expected).astype(np.int64)


def bit_lengths(magnitudes: Integers) -> Integers:
    """Bit length of each magnitude below 2^53: 0 of 0, 1 of 1, 2 of 2 and 3, ..."""
    # The highest bits of a float64 are its exponent, 1022 above the bits of an integer.
    exponents = magnitudes.astype(np.float64).view(np.int64) >> 52
    return np.asarray(np.maximum(exponents - 1022, 0))


def detail_widths(values: Integers) -> Integers:
    """Number of bits of each magnitude below its two highest, which `coarse` leaves out."""
    magnitudes = np.abs(values)
    widths = np.zeros_like(magnitudes)
    large = magnitudes > 3  # few, as a rule
    widths[large] = bit_lengths(magnitudes[large]) - 2
    return widths


def coarse(values: Integers) -> Integers:
    """The values with all but the two highest bits of their magnitudes set to 0."""
    kept = values.copy()
    large = np.abs(values) > 3
    widths = detail_widths(values[large])
    kept[large] = np.sign(values[large]) * (np.abs(values[large]) >> widths << widths)
    return kept


@lru_cache(maxsize=1)
def _powers_of_decay() -> list[Integers]:
    """Initial probabilities of shape (N_EXPECTED,): the 1st, 2nd, 4th, ... power of the decay.

    Probabilities of geometrically distributed magnitudes of mean m fall by m / (m + 1) from each to
    the next.
    """
    mean = mean_of_class(np.arange(N_EXPECTED, dtype=np.int64))
    powers = [mean * CERTAIN // (mean + UNIT)]
    for _ in range(MAX_LENGTH - 2):
        powers.append(powers[-1] * powers[-1] >> PROBABILITY_BITS)
    return powers
