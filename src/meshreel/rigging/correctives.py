"""Corrective morph targets: modes of the residual of a skin, in its rest pose.

glTF and engines apply morph targets before skinning. So residuals are pulled back through the
blended matrices of the skin, as in pose-space deformation (Lewis et al., SIGGRAPH 2000).
"""

import math

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Singles
from meshreel.model.rig import BYTE, Correctives
from meshreel.rigging.decomposition import extend

MAX_TARGETS = 64

PULL_DAMPING = 0.02
"""Added to the squares of singular values of blended matrices, which are 1 for rotations: where
blending collapses a vertex, hardly any displacement would move it."""

MIN_LEVELS = 3


class CorrectiveSearch:
    """Correctives of a residual, fitted round by round.

    Parameters
    ----------
    residuals : float32 array of shape (T, V, 3)
        The animation minus the skin.
    blended : float32 array of shape (T, V, 3, 3)
        Blended matrices of the skin.
    unit : float
        Displacement of a target with value 1 and weight 1, in the unit of the residuals.
    rounding : float
        Typical rounding error of a displacement.
    """

    def __init__(self, residuals: Singles, blended: Singles, unit: float, rounding: float) -> None:
        self._residuals, self._blended = residuals, blended
        self._unit, self._rounding = unit, rounding
        self._aims = residuals.copy()
        self._pull = np.empty_like(blended)
        damping = PULL_DAMPING * np.eye(3, dtype=np.float32)
        for pull, matrices in zip(self._pull, blended, strict=True):
            transposed = matrices.transpose(0, 2, 1)
            pull[:] = np.linalg.solve(transposed @ matrices + damping, transposed)

    def round(self, n_targets: int, bound: float) -> tuple[Correctives, float, float]:
        """Return a number of targets, with their root mean squared and their largest error.

        Afterwards, the aims are farther beyond the residuals whose error exceeds the bound.
        """
        rest_aims = self._pull_back()
        targets = self._targets(rest_aims, n_targets)
        values = targets.reshape(len(targets), -1) * np.float32(self._unit / BYTE)
        # As if blended matrices were rotations; aims make up for the difference.
        gram = (values @ values.T).astype(np.float64)
        gram += 1e-9 * (np.trace(gram) + 1e-30) / len(targets) * np.eye(len(targets))
        matches = (values @ rest_aims.T).astype(np.float64)
        weights = np.linalg.solve(gram, matches).T.astype(np.float32)
        lengths = np.empty(self._residuals.shape[:2], np.float32)
        for frame, residuals in enumerate(self._residuals):
            displacements = (weights[frame] @ values).reshape(-1, 3)
            missing = residuals - np.einsum("vab,vb->va", self._blended[frame], displacements)
            self._aims[frame] = residuals + extend(self._aims[frame] - residuals, missing, bound)
            lengths[frame] = np.linalg.norm(missing, axis=1)
        mean = math.sqrt(float(np.square(lengths).mean()))
        return Correctives(targets, weights), mean, float(lengths.max())

    def count_for(self, share: float) -> int:
        """Return how many modes leave at most this share of the squared residual."""
        rest_aims = self._pull_back()
        squares = np.linalg.eigvalsh((rest_aims @ rest_aims.T).astype(np.float64))[::-1]
        remaining = 1 - np.cumsum(np.maximum(squares, 0)) / max(float(squares.sum()), 1e-300)
        return int(np.count_nonzero(remaining > share)) + 1

    def _pull_back(self) -> Singles:
        """Return the aims in the rest pose, of shape (T, 3 V)."""
        pairs = zip(self._pull, self._aims, strict=True)
        return np.stack([np.einsum("vab,vb->va", pull, aims).ravel() for pull, aims in pairs])

    def _targets(self, rest_aims: Singles, n_targets: int) -> npt.NDArray[np.int8]:
        """Return the main modes of aims in the rest pose, of shape (K, V, 3)."""
        _, vectors = np.linalg.eigh((rest_aims @ rest_aims.T).astype(np.float64))
        main = vectors[:, ::-1][:, :n_targets].astype(np.float32)
        modes = main.T @ rest_aims
        largest = np.maximum(np.abs(modes).max(axis=1), 1e-30)
        # A mode with weights of length 1 has a mean weight of T^-1/2.
        step = math.sqrt(12 * len(rest_aims)) * self._rounding
        levels = np.clip(np.ceil(largest / step), MIN_LEVELS, BYTE)
        integers = np.rint(modes * (levels / largest)[:, np.newaxis]).astype(np.int8)
        return np.asarray(integers.reshape(len(modes), -1, 3))
