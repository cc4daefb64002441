"""Fields of a key block that another block reuses, and what they leave of it."""

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
    """How the fields of a key block move in another.

    Attributes
    ----------
    integers : int32 array of shape (R, C, T)
        Residuals of their vectors over time.
    coding : BasisCoding
        Of the vectors of the block.
    left : BlockFrames
        What they leave of the frames.
    """

    integers: npt.NDArray[np.int32]
    coding: BasisCoding
    left: BlockFrames


@staged("reused fields")
def reuse_fields(
    frames: BlockFrames,
    values: Floats,
    number: Integers,
    step: float,
    finer: float,
    price: float,
) -> ReusedFields | None:
    """The fields of a key block that come nearest to frames; None if they do not serve.

    Parameters
    ----------
    frames : BlockFrames
    values : float64 array of shape (V, K)
        Of the key block, in coding order.
    number : integer array of shape (V,)
        Place of each vertex in coding order.
    step : float
        By which the values are multiplied, in diagonals.
    finer : float
        As in `Layout`.
    price : float
        Squared steps that a bit is worth.
    """
    n_reused = min(values.shape[1], frames.n_columns * frames.n_frames)
    fields = np.ascontiguousarray(values[number, :n_reused])
    wanted = _nearest_vectors(frames, fields) / step
    lengths = lengths_of(values, n_reused, finer)
    scaled = wanted * lengths
    if not np.abs(scaled).max() < LARGEST_INTEGER:
        return None
    scaled = scaled.T.reshape(n_reused, frames.n_columns, frames.n_frames)
    coding = choose_coding(frames, scaled, step, finer, price)
    integers = encode_basis(scaled, price, coding)
    does_something = np.flatnonzero(integers.any(axis=(1, 2)))
    if not len(does_something):
        return None
    n_reused = int(does_something[-1]) + 1
    integers = np.ascontiguousarray(integers[:n_reused])
    vectors = basis_vectors(integers, coding, lengths[:n_reused]) * step
    subtracted = vectors, np.ascontiguousarray(fields[:, :n_reused])
    left = BlockFrames(frames.vertices, frames.frame, frames.order, subtracted)
    return ReusedFields(integers, coding, left)


def _nearest_vectors(frames: BlockFrames, fields: Floats) -> Floats:
    """Vectors of shape (C T, R) whose product with fields of shape (V, R) is nearest to frames."""
    pieces = chunks(frames.n_verts, CHUNK_VERTICES)
    parts: list[Floats] = [np.empty(0)] * len(pieces)

    def multiply(place: int) -> None:
        parts[place] = frames.coordinates(pieces[place]) @ fields[pieces[place]]

    in_threads(multiply, range(len(pieces)))
    inverse = np.linalg.pinv(fields.T @ fields, hermitian=True)
    return np.asarray(sum(parts[1:], parts[0]) @ inverse)
