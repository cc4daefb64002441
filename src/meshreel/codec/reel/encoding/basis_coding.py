"""Basis vectors over time to integers, by times or by cosines: an encoder's choice for each block.

Short, periodic and smooth motion takes fewer bits as cosines, long motion with sudden changes as
times that are predicted from those around. docs/codec.md, "Cosines over time".
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.reel.encoding.block_frames import LARGEST_INTEGER, BlockFrames
from meshreel.codec.reel.encoding.rest import find_rests
from meshreel.codec.reel.normative.timeline import COARSEST, NO_REST, Rests
from meshreel.kernel.frames import (
    MAX_COSINES,
    cosine_vectors,
    encode_cosines,
    encode_times,
    time_vectors,
)

Floats = npt.NDArray[np.float64]

SAMPLED_MODES = 16
"""Modes, spread over all, that are tried in both codings: at most these."""

ERROR_WEIGHT = 0.5
"""Share of the bits that errors count for. With all of them KG error gains, but STED loses where
cosines take more bits and leave smaller errors."""

LEAST_GAIN = 0.01
"""Share of the estimated cost that cosines have to save; the difference of two estimates is within
about 2 % of the bytes of a basis."""

GROUP = 4
"""Integers of a column whose mean magnitude says how many bits they take."""


@dataclass(frozen=True)
class BasisCoding:
    """How the basis vectors of a block become integers.

    Attributes
    ----------
    rests, has_cosines
        As in `Layout`.
    """

    rests: Rests = NO_REST
    has_cosines: bool = False

    def encode(self, wanted: Floats, price: float) -> npt.NDArray[np.int32]:
        """Integers of shape (K, C, T) of basis vectors near to wanted ones, as `encode_times`."""
        if self.has_cosines:
            return encode_cosines(wanted, price)
        return encode_times(wanted, price, self.rests.flags(wanted.shape[2]), self.rests.bits)

    def vectors(self, coded: npt.NDArray[np.int32], lengths: Floats) -> Floats:
        """Basis vectors of shape (C, T, K), the first divided by lengths, as `time_vectors`."""
        if self.has_cosines:
            return cosine_vectors(coded, lengths)
        return time_vectors(coded, lengths, self.rests.flags(coded.shape[2]), self.rests.bits)


def choose_coding(
    frames: BlockFrames, wanted: Floats, step: float, finer: float, price: float
) -> BasisCoding:
    """The coding of a block: cosines where nothing rests and they save bits.

    Parameters
    ----------
    frames, wanted, step, finer, price
        As of `find_rests`.
    """
    rests = find_rests(frames, wanted, step, finer, price)
    return BasisCoding(rests, not rests.runs and saves_bits(wanted, price))


def saves_bits(wanted: Floats, price: float) -> bool:
    """Whether cosines are estimated to save bits, errors counted as part of what would undo them.

    Parameters
    ----------
    wanted : float64 array of shape (K, C, T)
        Basis vectors, in steps.
    price : float
        Squared steps that a bit is worth; 0 compares bits alone.
    """
    n_modes, _, n_frames = wanted.shape
    largest = math.sqrt(n_frames) * float(np.abs(wanted).max(initial=0.0))  # of a coefficient
    if n_frames > MAX_COSINES or largest >= LARGEST_INTEGER:
        return False
    some = wanted[:: max(1, -(-n_modes // SAMPLED_MODES))]
    usual, cosines = (_cost(some, price, has_cosines) for has_cosines in (False, True))
    return cosines < (1.0 - LEAST_GAIN) * usual


def _cost(wanted: Floats, price: float, has_cosines: bool) -> float:
    """Estimated bits of basis vectors, and the share that counts of those that undo their error."""
    coding = BasisCoding(has_cosines=has_cosines)
    coded = coding.encode(wanted, price)
    levels = (
        [slice(None)]
        if has_cosines
        else [slice(0, None, COARSEST), slice(2, None, COARSEST), slice(1, None, 2)]
    )
    bits = sum(_estimated_bits(coded[:, :, level]) for level in levels)
    found = np.moveaxis(coding.vectors(coded, np.ones(len(coded))), 2, 0)
    squared_error = float(np.square(found - wanted).sum())
    return bits + (ERROR_WEIGHT * squared_error / price if price else 0.0)


def _estimated_bits(integers: npt.NDArray[np.int32]) -> float:
    """Bits of integers of shape (K, C, n), whose magnitudes are spread geometrically in groups."""
    n = integers.shape[2]
    if not n:
        return 0.0
    starts = np.arange(0, n, GROUP)
    counts = np.diff(starts, append=n)
    mean = np.add.reduceat(np.abs(integers.astype(np.float64)), starts, axis=2) / counts
    magnitudes = np.log2(1.0 + mean) + mean * np.log2(1.0 + 1.0 / np.maximum(mean, 1e-300))
    return float(((magnitudes + mean / (1.0 + mean)) * counts).sum())
