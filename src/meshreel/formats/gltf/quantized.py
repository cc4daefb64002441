"""Positions and morph targets quantized to small integers: a box from -1 to 1, optimal weights."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles
from meshreel.codec.subspace.least_squares import solve_gram
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import Vertices
from meshreel.runtime.threads import chunks, in_threads

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
    levels: Singles

    def __len__(self) -> int:
        return len(self.levels)

    @cached_property
    def values(self) -> Singles:
        """The represented values, of shape (K, N)."""
        return np.asarray(self.integers / self.levels[:, None], np.float32)

    @property
    def n_int8(self) -> int:
        """Number of targets that fit into int8."""
        return int((self.levels == BYTE).sum())


def integer_targets(
    fields: Singles, max_weights: npt.NDArray[np.float64], noise: float
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


def best_weights(targets: IntegerTargets, frames: Singles) -> Singles:
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


def project(time_vectors: Singles, frames: Singles) -> Singles:
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


@dataclass(frozen=True, eq=False)
class Placement:
    """A translation and a uniform scale, for the node of a mesh.

    Attributes
    ----------
    offset : float64 array of shape (3,)
        Center of the box, exact in float32.
    scale : float
        Half size of the box, positive and exact in float32.
    """

    offset: Floats
    scale: float


IDENTITY = Placement(np.zeros(3), 1.0)
"""The placement that leaves positions unchanged."""


@dataclass(frozen=True, eq=False)
class PlacedFrames:
    """Frames as a base mesh of integers, and displacements from it.

    Attributes
    ----------
    placement : Placement
    base : int16 array of shape (V, 3)
    displacements : float32 array of shape (T, 3 V)
        From the integer base, in units of the placement.
    """

    placement: Placement
    base: npt.NDArray[np.int16]
    displacements: npt.NDArray[np.float32]


def mean_frame(frames: Vertices) -> Floats:
    """Return the mean position of every vertex over all frames, of shape (V, 3)."""
    return np.asarray(frames.mean(axis=0, dtype=np.float64))


def max_displacements(frames: Vertices, base: Floats) -> Floats:
    """Return the largest distance of a vertex from the base, in each frame."""
    return np.array([np.linalg.norm(frame - base, axis=1).max() for frame in frames])


def place_static(base: Vertices) -> tuple[Placement, npt.NDArray[np.float32]]:
    """Return a static mesh in float32, relative to its center unless it is exact in float32."""
    rest = base.astype(np.float32)
    if (rest == base).all():
        return IDENTITY, rest
    offset = _center(base)
    return Placement(offset, 1.0), (base - offset).astype(np.float32)


def place_frames(frames: Vertices, base: Floats) -> PlacedFrames:
    """Return frames of shape (T, V, 3) relative to a base, with all coordinates within -1 to 1."""
    offset = _center(base)
    max_distance = float(max_displacements(frames, base).max())
    reach = max(float(np.abs(base - offset).max()), max_distance)
    smallest = float(np.finfo(np.float32).tiny)
    scale = float(np.nextafter(np.float32(max(reach, smallest)), np.float32(np.inf)))
    integers = np.rint((base - offset) / scale * SHORT).astype(np.int16)
    displacements = np.empty((len(frames), base.size), np.float32)
    rounded = integers / np.float64(SHORT)
    for row, frame in zip(displacements, frames, strict=True):
        row[:] = ((frame - offset) / scale - rounded).ravel()
    return PlacedFrames(Placement(offset, scale), integers, displacements)


def _center(base: Vertices) -> Floats:
    center = (base.min(axis=0) + base.max(axis=0)) / 2
    return np.asarray(center.astype(np.float32), np.float64)


def check_range(low: Floats, high: Floats) -> None:
    """Check that positions fit into float32, the only float type of glTF.

    Raises
    ------
    InvalidInputError
        If a coordinate is too large.
    """
    largest = float(np.maximum(-low, high).max())
    allowed = float(np.finfo(np.float32).max) / 4
    if largest > allowed:
        raise InvalidInputError(
            f"glTF stores float32 positions, up to {allowed:.2g}; got {largest:g}; scale the model"
        )
