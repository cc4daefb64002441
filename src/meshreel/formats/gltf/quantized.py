"""Morph targets as small integers, and the weights that suit these best."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.codec.subspace.least_squares import solve_gram
from meshreel.runtime.threads import chunks, in_threads

Floats = npt.NDArray[np.float32]

BYTE, SHORT = 127, 32767
"""The integers that stand for 1 in a normalised accessor of int8 and of int16."""

TARGETS_AT_ONCE, VALUES_AT_ONCE = 16, 8192


@dataclass(frozen=True, eq=False)
class IntegerTargets:
    """Morph targets, each scaled so that its largest coordinate is 1.

    Attributes
    ----------
    integers : int16 array of shape (K, N)
        A row of coordinates for each target.
    levels : float32 array of shape (K,)
        `BYTE` or `SHORT`: the integer that stands for 1.
    """

    integers: npt.NDArray[np.int16]
    levels: Floats

    def __len__(self) -> int:
        return len(self.levels)

    @cached_property
    def values(self) -> Floats:
        """The values of the integers, of shape (K, N)."""
        return np.asarray(self.integers / self.levels[:, None], np.float32)

    @property
    def n_bytes(self) -> int:
        """How many targets fit into int8."""
        return int((self.levels == BYTE).sum())


def integer_targets(fields: Floats, reach: npt.NDArray[np.float64], noise: float) -> IntegerTargets:
    """Targets as integers, in int8 where that is fine enough.

    Rounding moves a vertex by a random step that is, in a coordinate, the step of the integers by
    the square root of 12 in the mean, times the weight. As many targets as may be are of int8, the
    smallest first, while all their steps together stay below `noise` in the mean.

    Parameters
    ----------
    fields : float32 array of shape (K, N)
        Changed: scaled to 1.
    reach : float array of shape (K,)
        The largest weight of each field.
    noise : float
        In the units of the fields.
    """
    largest = np.abs(fields).max(axis=1)
    largest[largest == 0] = 1
    variances = 3 * (reach * largest / BYTE) ** 2 / 12
    order = np.argsort(variances)
    levels = np.full(len(fields), SHORT, np.float32)
    levels[order[np.cumsum(variances[order]) <= noise**2]] = BYTE
    integers = np.empty(fields.shape, np.int16)

    def quantize(rows: slice) -> None:
        fields[rows] *= (levels / largest)[rows, None]
        integers[rows] = np.rint(fields[rows])

    in_threads(quantize, chunks(len(fields), TARGETS_AT_ONCE))
    return IntegerTargets(integers, levels)


def best_weights(targets: IntegerTargets, frames: Floats) -> Floats:
    """The weights of all targets in every frame, of shape (T, K), by least squares.

    Parameters
    ----------
    frames : float32 array of shape (T, N)
        What the targets are to add up to.
    """
    values = targets.values
    gram = np.empty((len(targets), len(targets)))
    products = np.empty((len(targets), len(frames)))

    def multiply(rows: slice) -> None:
        gram[rows] = values[rows] @ values.T
        products[rows] = values[rows] @ frames.T

    in_threads(multiply, chunks(len(targets), TARGETS_AT_ONCE))
    return np.ascontiguousarray(solve_gram(gram, products).T, dtype=np.float32)


def project(time_vectors: Floats, frames: Floats) -> Floats:
    """``time_vectors^T frames``: the field of each mode, of shape (K, N).

    Parameters
    ----------
    time_vectors : float32 array of shape (T, K)
    frames : float32 array of shape (T, N)
    """
    fields = np.empty((time_vectors.shape[1], frames.shape[1]), np.float32)

    def multiply(columns: slice) -> None:
        fields[:, columns] = time_vectors.T @ frames[:, columns]

    in_threads(multiply, chunks(frames.shape[1], VALUES_AT_ONCE))
    return fields
