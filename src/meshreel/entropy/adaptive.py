"""Adaptive binary models: bits whose probabilities both sides learn, in one ANS coder.

Writer and reader share the same code: `code` takes the bits to write, or None to read them, and
returns the bits either way. So the model of a stream is written once and cannot differ between the
two.
"""

from typing import Protocol

import constriction
import numpy as np
import numpy.typing as npt

from meshreel.errors import CorruptStreamError

Integers = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Bits = npt.NDArray[np.bool_]

PROBABILITY_BITS = 16
CERTAIN = 1 << PROBABILITY_BITS
"""Probabilities are integers divided by CERTAIN, which float64 holds exactly."""

LEAST_PROBABILITY = 16  # what never happened so far may still happen
START_WEIGHT = 12  # how many observations a first guess stands for
INCREMENT = 1024  # of a count: first guesses are fractions of an observation
FULL_COUNT = 128 * INCREMENT  # counts above it are halved, so that old observations fade

_BERNOULLI = constriction.stream.model.Bernoulli(perfect=False)


class BitPort(Protocol):
    """A destination or a source of bits."""

    def code(self, truth: Bits | None, probabilities: Floats) -> Bits:
        """The bits, each 1 with its probability; `truth` holds them when they are written."""
        ...


class BitWriter:
    """Collects bits and codes them all at the end, since the coder is a stack."""

    def __init__(self) -> None:
        self._bits: list[Bits] = []
        self._probabilities: list[Floats] = []

    def code(self, truth: Bits | None, probabilities: Floats) -> Bits:
        """The bits given, kept to be written."""
        assert truth is not None  # only a reader is asked for what nobody knows yet
        self._bits.append(truth)
        self._probabilities.append(probabilities)
        return truth

    def words(self) -> bytes:
        """All bits, coded in 32-bit words."""
        coder = constriction.stream.stack.AnsCoder()
        if self._bits:
            bits = np.concatenate(self._bits).astype(np.int32)
            coder.encode_reverse(bits, _BERNOULLI, np.concatenate(self._probabilities))
        return bytes(coder.get_compressed().astype("<u4").tobytes())


class BitReader:
    """Decodes the bits that a `BitWriter` coded.

    Raises
    ------
    CorruptStreamError
        If no coder ends with these words.
    """

    def __init__(self, words: bytes) -> None:
        try:
            self._coder = constriction.stream.stack.AnsCoder(
                np.frombuffer(words, "<u4").astype(np.uint32)
            )
        except ValueError as error:
            raise CorruptStreamError(f"the coded bits are damaged: {error}") from error

    def code(self, truth: Bits | None, probabilities: Floats) -> Bits:
        """The next bits; `truth` is ignored."""
        if not len(probabilities):
            return np.zeros(0, np.bool_)
        return np.asarray(self._coder.decode(_BERNOULLI, probabilities) != 0)

    def finish(self) -> None:
        """Check that all bits were read.

        Raises
        ------
        CorruptStreamError
            If words are left over.
        """
        if not self._coder.is_empty():
            raise CorruptStreamError("coded bits are left over")


class AdaptiveBits:
    """Probabilities of a bit in many contexts, learned from the bits already coded.

    Parameters
    ----------
    first_guess : integer array of shape (n_contexts,)
        Initial probability of a 1, in units of 1 / CERTAIN.
    """

    def __init__(self, first_guess: Integers) -> None:
        guess = np.clip(first_guess, LEAST_PROBABILITY, CERTAIN - LEAST_PROBABILITY)
        self._total = np.full(len(guess), START_WEIGHT * INCREMENT, np.int64)
        self._ones = (guess * self._total) >> PROBABILITY_BITS
        self._probabilities = _probabilities(self._ones, self._total)

    def code(self, port: BitPort, truth: Bits | None, contexts: Integers) -> Bits:
        """A bit in each of the contexts, all coded before any of them updates a probability."""
        if not len(contexts):
            return np.zeros(0, np.bool_)
        bits = port.code(truth, self._probabilities[contexts])
        counts = np.bincount(contexts, minlength=len(self._total))
        ones = np.bincount(contexts[bits.nonzero()], minlength=len(self._total))
        (used,) = counts.nonzero()
        self._learn(used, INCREMENT * counts[used], INCREMENT * ones[used])
        return bits

    def _learn(self, used: Integers, counts: Integers, ones: Integers) -> None:
        counts += self._total[used]
        ones += self._ones[used]
        is_full = counts > FULL_COUNT
        counts >>= is_full
        ones >>= is_full
        self._total[used], self._ones[used] = counts, ones
        self._probabilities[used] = _probabilities(ones, counts)


def _probabilities(ones: Integers, total: Integers) -> Floats:
    """Shares of ones, rounded down, but never 0 or 1."""
    shares = (ones << PROBABILITY_BITS) // total
    limited = np.minimum(np.maximum(shares, LEAST_PROBABILITY), CERTAIN - LEAST_PROBABILITY)
    return np.asarray(limited / CERTAIN)
