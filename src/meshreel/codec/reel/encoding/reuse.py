"""Reuse of the fields of a key block in another block."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.reel.encoding.basis_coding import choose_coding
from meshreel.codec.reel.encoding.block_frames import CHUNK_VERTICES, LARGEST_INTEGER, BlockFrames
from meshreel.kernel.basis import BasisCoding, basis_vectors, encode_basis, lengths_of
from meshreel.runtime.profiling import staged
from meshreel.runtime.threads import chunks, in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class ReusedFields:
    """Basis vectors with which a block reuses fields of its key block.

    Attributes
    ----------
    integers : int32 array of shape (R, C, T)
        Residuals of the basis vectors.
    coding : BasisCoding
        Coding of all basis vectors of the block.
    remainder : BlockFrames
        The frames minus the reused modes.
    """

    integers: npt.NDArray[np.int32]
    coding: BasisCoding
    remainder: BlockFrames


@staged("reused fields")
def reuse_fields(
    frames: BlockFrames,
    values: Floats,
    number: Integers,
    step: float,
    finer: float,
    rate_weight: float,
) -> ReusedFields | None:
    """Fit frames by the fields of a key block; return None if these are not usable.

    Parameters
    ----------
    frames : BlockFrames
    values : float64 array of shape (V, K)
        Fields of the key block, in coding order.
    number : integer array of shape (V,)
        Position of each vertex in coding order.
    step : float
        Step of the values, in diagonals.
    finer : float
        As in `Layout`.
    rate_weight : float
        As in `FieldChoices`.
    """
    n_reused = min(values.shape[1], frames.n_columns * frames.n_frames)
    fields = np.ascontiguousarray(values[number, :n_reused])
    lengths = lengths_of(values, n_reused, finer)
    scaled = _fitted_vectors(frames, fields) / step * lengths
    if not np.abs(scaled).max() < LARGEST_INTEGER:
        return None
    scaled = scaled.T.reshape(n_reused, frames.n_columns, frames.n_frames)
    coding = choose_coding(frames, scaled, step, finer, rate_weight)
    integers = encode_basis(scaled, rate_weight, coding)
    used_modes = np.flatnonzero(integers.any(axis=(1, 2)))
    if not len(used_modes):
        return None
    n_reused = int(used_modes[-1]) + 1
    integers = np.ascontiguousarray(integers[:n_reused])
    vectors = basis_vectors(integers, coding, lengths[:n_reused]) * step
    subtracted = vectors, np.ascontiguousarray(fields[:, :n_reused])
    remainder = BlockFrames(frames.vertices, frames.frame, frames.order, subtracted)
    return ReusedFields(integers, coding, remainder)


def _fitted_vectors(frames: BlockFrames, fields: Floats) -> Floats:
    """Least-squares vectors, of shape (C T, R), that fit frames with fields of shape (V, R)."""
    pieces = chunks(frames.n_verts, CHUNK_VERTICES)
    parts: list[Floats] = [np.empty(0)] * len(pieces)

    def multiply(place: int) -> None:
        parts[place] = frames.coordinates(pieces[place]) @ fields[pieces[place]]

    in_threads(multiply, range(len(pieces)))
    inverse = np.linalg.pinv(fields.T @ fields, hermitian=True)
    return np.asarray(sum(parts[1:], parts[0]) @ inverse)
