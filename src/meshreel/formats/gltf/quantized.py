"""Morph targets quantized to small integers, and their optimal weights."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.codec.subspace.least_squares import solve_gram
from meshreel.runtime.threads import chunks, in_threads

Floats = npt.NDArray[np.float32]

BYTE, SHORT = 127, 32767
"""Integers that represent 1 in normalized accessors of int8 and int16."""

PIECE_TARGETS, PIECE_VALUES = 16, 8192


@dataclass(frozen=True, eq=False)
class IntegerTargets:
    """Morph targets, each scaled so that its largest coordinate is 1.

    Attributes
    ----------
    integers : int16 array of shape (K, N)
        Coordinates of each target.
    levels : float32 array of shape (K,)
        The integer that represents 1 in each target, `BYTE` or `SHORT`.
    """

    integers: npt.NDArray[np.int16]
    levels: Floats

    def __len__(self) -> int:
        return len(self.levels)

    @cached_property
    def values(self) -> Floats:
        """The represented values, of shape (K, N)."""
        return np.asarray(self.integers / self.levels[:, None], np.float32)

    @property
    def n_int8(self) -> int:
        """Number of targets that fit into int8."""
        return int((self.levels == BYTE).sum())


def integer_targets(
    fields: Floats, max_weights: npt.NDArray[np.float64], noise: float
) -> IntegerTargets:
    """Return quantized targets, in int8 where that is precise enough.

    The standard deviation of the rounding error of a coordinate is the integer step divided by the
    square root of 12, times the weight. As many targets as possible become int8, smallest first,
    as long as their combined error stays below `noise` in the root mean square.

    Parameters
    ----------
    fields : float32 array of shape (K, N)
        Scaled in place.
    max_weights : float array of shape (K,)
        Largest absolute weight of each field.
    noise : float
        In the units of the fields.
    """
    largest = np.abs(fields).max(axis=1)
    largest[largest == 0] = 1
    variances = 3 * (max_weights * largest / BYTE) ** 2 / 12
    order = np.argsort(variances)
    levels = np.full(len(fields), SHORT, np.float32)
    levels[order[np.cumsum(variances[order]) <= noise**2]] = BYTE
    integers = np.empty(fields.shape, np.int16)

    def quantize(rows: slice) -> None:
        fields[rows] *= (levels / largest)[rows, None]
        integers[rows] = np.rint(fields[rows])

    in_threads(quantize, chunks(len(fields), PIECE_TARGETS))
    return IntegerTargets(integers, levels)


def best_weights(targets: IntegerTargets, frames: Floats) -> Floats:
    """Return the weights of all targets in every frame by least squares, of shape (T, K).

    Parameters
    ----------
    targets : IntegerTargets
    frames : float32 array of shape (T, N)
        The displacements to approximate.
    """
    values = targets.values
    gram = np.empty((len(targets), len(targets)))
    products = np.empty((len(targets), len(frames)))

    def multiply(rows: slice) -> None:
        gram[rows] = values[rows] @ values.T
        products[rows] = values[rows] @ frames.T

    in_threads(multiply, chunks(len(targets), PIECE_TARGETS))
    return np.ascontiguousarray(solve_gram(gram, products).T, dtype=np.float32)


def project(time_vectors: Floats, frames: Floats) -> Floats:
    """Return ``time_vectors^T frames``, the field of each mode, of shape (K, N).

    Parameters
    ----------
    time_vectors : float32 array of shape (T, K)
    frames : float32 array of shape (T, N)
    """
    fields = np.empty((time_vectors.shape[1], frames.shape[1]), np.float32)

    def multiply(columns: slice) -> None:
        fields[:, columns] = time_vectors.T @ frames[:, columns]

    in_threads(multiply, chunks(frames.shape[1], PIECE_VALUES))
    return fields
