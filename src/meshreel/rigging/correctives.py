"""Corrective morph targets: modes of the residual of a skin, in its rest pose.

glTF and engines apply morph targets before skinning. So residuals are pulled back through the
blended matrices of the skin, as in pose-space deformation (Lewis et al., SIGGRAPH 2000).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats

BYTE = 127
MAX_TARGETS = 64
PULL_DAMPING = 0.02
"""Added to the squares of singular values of blended matrices, which are 1 for rotations: where
blending collapses a vertex, hardly any displacement would move it."""


@dataclass(frozen=True, eq=False)
class Correctives:
    """Morph targets.

    Attributes
    ----------
    targets : int8 array of shape (K, V, 3)
        Displacements in the rest pose; 127 is 1 unit.
    weights : float32 array of shape (T, K)
    """

    targets: npt.NDArray[np.int8]
    weights: npt.NDArray[np.float32]

    @classmethod
    def none(cls, n_frames: int, n_verts: int) -> "Correctives":
        """Return no targets."""
        return cls(np.zeros((0, n_verts, 3), np.int8), np.zeros((n_frames, 0), np.float32))


class CorrectiveSearch:
    """Correctives of a residual, more and more of them.

    Parameters
    ----------
    residuals : float64 array of shape (3 T, V)
        What a skin lacks, in model units.
    blended : float32 array of shape (T, V, 3, 3)
        Blended matrices of the skin.
    unit : float
        Displacement of a target with value 1 and weight 1, in model units.
    """

    def __init__(
        self, residuals: Floats, blended: npt.NDArray[np.float32], unit: float
    ) -> None:
        n_frames, n_verts = blended.shape[:2]
        self._wanted = residuals.reshape(n_frames, 3, n_verts).transpose(0, 2, 1)
        self._blended, self._unit = blended, unit
        pulled = np.empty((n_frames, 3 * n_verts), np.float32)
        damping = PULL_DAMPING * np.eye(3)
        for row, matrices, wanted in zip(pulled, blended, self._wanted, strict=True):
            gram = np.einsum("vba,vbc->vac", matrices, matrices) + damping
            matches = np.einsum("vba,vb->va", matrices, wanted)
            row[:] = np.linalg.solve(gram, matches[:, :, np.newaxis])[:, :, 0].ravel()
        self._pulled = pulled
        squares, vectors = np.linalg.eigh((pulled @ pulled.T).astype(np.float64))
        self._shares = np.maximum(squares[::-1], 0) / max(squares.sum(), 1e-300)
        self._vectors = vectors[:, ::-1]

    def count_for(self, share: float) -> int:
        """Return the number of modes without which this share of the squared residual remains."""
        remaining = 1 - np.cumsum(self._shares)
        return int(np.searchsorted(-remaining, -share)) + 1

    def fit(self, n_targets: int) -> Correctives:
        """Return so many targets, with the weights that reduce the residual most."""
        n_targets = min(n_targets, len(self._vectors))
        modes = self._vectors[:, :n_targets].T.astype(np.float32) @ self._pulled
        largest = np.maximum(np.abs(modes).max(axis=1, keepdims=True), 1e-30)
        targets = np.rint(modes / largest * BYTE).astype(np.int8)
        targets = targets.reshape(n_targets, -1, 3)
        values = targets.astype(np.float32) * np.float32(self._unit / BYTE)
        weights = np.empty((len(self._wanted), n_targets), np.float32)
        for row, matrices, wanted in zip(weights, self._blended, self._wanted, strict=True):
            moved = np.einsum("vab,kvb->kva", matrices, values, optimize=True)
            flat = moved.reshape(n_targets, -1).astype(np.float64)
            gram = flat @ flat.T
            gram += 1e-9 * np.trace(gram) / n_targets * np.eye(n_targets)
            row[:] = np.linalg.solve(gram, flat @ wanted.ravel())
        return Correctives(targets, weights)
