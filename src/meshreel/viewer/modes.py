"""A block of frames as fields and weights, which a page combines."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.decoded_block import DecodedBlock
from meshreel.codec.frame_products import ProductFrames
from meshreel.codec.inspect import StreamInfo
from meshreel.codec.methods import method_named
from meshreel.errors import CorruptStreamError
from meshreel.subspace.pca import joint_trajectories

Floats = npt.NDArray[np.float64]

LEFT_OUT = 1e-6
"""Modes of frames that come without any are left out if they move no vertex by more diagonals."""


@dataclass(frozen=True)
class Modes:
    """Frames of a block as ``sum_k weights[t, k, axis] fields[k, v]``, in diagonals.

    Attributes
    ----------
    fields : float64 array of shape (K, V)
        In order of importance: the first ones are the coarser animation.
    weights : float64 array of shape (T_b, K, 3)
    """

    fields: Floats
    weights: Floats

    def frames(self, wanted: slice) -> Floats:
        """Coordinate matrices of shape (3, frames, V) of a range of frames."""
        return ProductFrames(np.moveaxis(self.weights, 2, 0), self.fields[None])(wanted)


def modes_of(block: DecodedBlock) -> Modes:
    """The modes of a decoded block, without its corrections and its exact positions.

    Those of `reel` are the modes of the stream. The paper's methods have modes of each axis: each
    is one that moves along this axis only. Blocks that are decoded frame by frame (`gft`,
    `pca-qs`) have no modes, and are decomposed here.

    Parameters
    ----------
    block : DecodedBlock

    Raises
    ------
    CorruptStreamError
        If they are beyond all numbers, as those of damaged blocks may be.
    """
    product = block.modes
    if product is None:
        modes = _joint_modes(block.frames_of(slice(0, block.n_frames)))
    elif len(product.coefficients) == 1:
        modes = Modes(product.coefficients[0], np.moveaxis(product.basis, 0, 2))
    else:
        modes = _modes_along_axes(product)
    if not (np.isfinite(modes.fields).all() and np.isfinite(modes.weights).all()):
        raise CorruptStreamError(
            f"frames {block.start}:{block.stop} decode to positions beyond all numbers"
        )
    return modes


def n_fields(info: StreamInfo, number: int) -> int:
    """How many modes the page is sent of a block; of those decomposed here, at most so many."""
    method = method_named(info.method)
    return method.n_joint_modes(info.n_modes[number], info.block_frames[number], info.n_verts)


def _joint_modes(matrices: Floats) -> Modes:
    """Principal components of coordinate matrices of shape (3, T, V)."""
    if not np.isfinite(matrices).all():
        return Modes(matrices[0], matrices)
    n_frames, n_verts = matrices.shape[1:]
    _, vectors = joint_trajectories(matrices, min(3 * n_frames, n_verts), LEFT_OUT)
    fields = vectors.T @ matrices.reshape(-1, n_verts)
    return Modes(fields, np.moveaxis(vectors.reshape(3, n_frames, -1), 0, 2))


def _modes_along_axes(product: ProductFrames) -> Modes:
    """Modes of each axis, of shape (3, T, K) and (3, K, V), as 3 K modes, the strongest first."""
    _, n_frames, n_modes = product.basis.shape
    fields = product.coefficients.reshape(3 * n_modes, -1)
    weights = np.zeros((n_frames, 3, n_modes, 3))
    for axis in range(3):
        weights[:, axis, :, axis] = product.basis[axis]
    lengths = np.linalg.norm(product.basis, axis=1).ravel()
    strengths = np.linalg.norm(fields, axis=1) * lengths
    order = np.argsort(-strengths, kind="stable")
    return Modes(fields[order], weights.reshape(n_frames, 3 * n_modes, 3)[:, order])
