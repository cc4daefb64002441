"""Changes integers of single vertices until they meet the error bound.

For given weights, vertices are independent: each needs three rows of integers for which its error
is within the bound in all frames. Starting at the nearest integers, greedy descent changes one
integer by one, the one with the best second-order estimate of the decrease in excess error, until
all frames are within the bound or no step helps.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Singles
from meshreel.formats.vat.pca.digits import Fields, largest_integer
from meshreel.runtime.threads import chunks, in_threads

EXCESS_THRESHOLD = np.float32(0.85)
"""Fraction of the squared bound beyond which squared errors count as excess."""

BOUND_SHARE = 0.9995
"""Fraction of the bound to reach, so that rounding errors do not exceed the bound."""

MAX_STEPS, MAX_TRIALS = 40, 3
"""Steps per vertex, and candidates evaluated exactly per step."""

PIECE_VERTS, RESIDUAL_PIECE_VERTS = 96, 1024
"""Vertices processed at once in a repair, and in the computation of residuals."""

MAX_RESTARTS, N_STARTS, PERTURBED_SHARE, SEED = 4, 64, 0.1, 1
"""Vertices of a piece that are restarted from perturbed integers, starts per vertex, share of
integers that are perturbed, and seed of the random numbers."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Errors of fields, per vertex and frame.

    Attributes
    ----------
    vectors : float32 array of shape (T, V, 3)
        Original minus reconstructed displacements.
    """

    vectors: Singles

    @classmethod
    def of(cls, displacements: Singles, fields: Fields) -> "Residuals":
        """Return the residuals of fields, for displacements of shape (T, 3 V)."""
        vectors = np.empty((len(displacements), displacements.shape[1] // 3, 3), np.float32)

        def subtract(verts: slice) -> None:
            columns = slice(3 * verts.start, 3 * verts.stop)
            decoded = fields.weights @ fields.integers[:, columns].astype(np.float32)
            difference = displacements[:, columns] - decoded
            vectors[:, verts] = difference.reshape(len(displacements), -1, 3)

        in_threads(subtract, chunks(vectors.shape[1], RESIDUAL_PIECE_VERTS))
        return cls(vectors)

    def distances(self) -> Singles:
        """Return the largest error of each vertex, of shape (V,)."""
        return np.asarray(np.sqrt(_squares(self.vectors).max(axis=0)))

    @property
    def error(self) -> float:
        """The largest error of all vertices."""
        return float(self.distances().max())


def repair(
    fields: Fields, residuals: Residuals, bound: float
) -> tuple[Fields, npt.NDArray[np.int64]]:
    """Return fields with integers changed to meet the bound, and the vertices that still do not.

    Vertices with the largest errors come first; once one of them cannot be repaired, the rest is
    skipped.

    Parameters
    ----------
    residuals : Residuals
        Residuals of these fields.
    """
    distances = residuals.distances()
    violating = np.flatnonzero(distances > BOUND_SHARE * bound)
    violating = violating[np.argsort(-distances[violating], kind="stable")]
    integers = fields.integers.reshape(len(fields.integers), -1, 3).copy()
    pieces = [violating[piece] for piece in chunks(len(violating), PIECE_VERTS)]
    descent = _IntegerDescent(fields.weights, largest_integer(fields.n_digits), bound)
    failed: list[int] = []

    def repair_piece(verts: npt.NDArray[np.int64]) -> None:
        if not failed:
            own = integers[:, verts]
            own_residuals = residuals.vectors[:, verts]
            is_failed = descent.descend(own, own_residuals)
            if is_failed.sum() <= MAX_RESTARTS:
                for index in np.flatnonzero(is_failed):
                    start, residual = integers[:, verts[index]], own_residuals[:, index]
                    if (repaired := descent.try_perturbed(start, residual)) is not None:
                        own[:, index], is_failed[index] = repaired, False
            failed.extend(verts[is_failed])
            integers[:, verts] = own

    # The worst vertices first and alone: if some of them fail, the rest is not worth the time.
    repair_piece(pieces[0])
    in_threads(repair_piece, pieces[1:])
    repaired = Fields(integers.reshape(fields.integers.shape), fields.weights, fields.n_digits)
    return repaired, np.array(sorted(failed), np.int64)


class _IntegerDescent:
    """Greedy descent over the integers of any number of vertices.

    Parameters
    ----------
    weights : float32 array of shape (T, K)
    largest : int64 array of shape (K,)
        Largest integer of each field.
    """

    def __init__(self, weights: Singles, largest: npt.NDArray[np.int64], bound: float) -> None:
        # In units of the bound, so that the limit is 1.
        self._weights = weights / np.float32(BOUND_SHARE * bound)
        self._squared_weights = np.square(self._weights)
        self._largest, self._unit = largest, np.float32(BOUND_SHARE * bound)

    def descend(self, integers: npt.NDArray[np.int32], residuals: Singles) -> npt.NDArray[np.bool_]:
        """Change the integers of vertices in place, and return which vertices violate the bound.

        Parameters
        ----------
        integers : int32 array of shape (K, N, 3)
        residuals : float32 array of shape (T, N, 3)
        """
        remaining = residuals / self._unit
        active = np.arange(remaining.shape[1])
        for _ in range(MAX_STEPS):
            squares = _squares(remaining[:, active])
            is_violating = squares.max(axis=0) > 1
            active, squares = active[is_violating], squares[:, is_violating]
            if not len(active):
                break
            active = active[self._step(integers, remaining, active, squares)]
        return np.asarray(_squares(remaining).max(axis=0) > 1)

    def try_perturbed(
        self, integers: npt.NDArray[np.int32], residuals: Singles
    ) -> npt.NDArray[np.int32] | None:
        """Return integers of one vertex within the bound, of shape (K, 3), or None.

        Descends from many starts, in which random integers are changed by one.

        Parameters
        ----------
        integers : int32 array of shape (K, 3)
        residuals : float32 array of shape (T, 3)
        """
        rng = np.random.default_rng(SEED)
        shape = (len(integers), N_STARTS, 3)
        odds = [PERTURBED_SHARE / 2, 1 - PERTURBED_SHARE, PERTURBED_SHARE / 2]
        changes = rng.choice([-1, 0, 1], shape, p=odds)
        largest = self._largest[:, None, None]
        starts = np.clip(integers[:, None] + changes, -largest, largest).astype(np.int32)
        changed = (starts - integers[:, None]).reshape(len(integers), -1).astype(np.float32)
        moved = (self._weights * self._unit @ changed).reshape(-1, N_STARTS, 3)
        solved = np.flatnonzero(~self.descend(starts, residuals[:, None] - moved))
        return starts[:, solved[0]] if len(solved) else None

    def _step(
        self,
        integers: npt.NDArray[np.int32],
        remaining: Singles,
        active: npt.NDArray[np.int64],
        squares: Singles,
    ) -> npt.NDArray[np.bool_]:
        """Take one step for each vertex that improves by one, and return which did."""
        own = remaining[:, active]
        before = _excess(squares)
        gains, signs = self._gains(own, squares, integers[:, active])
        rows = np.arange(len(active))
        has_stepped = np.zeros(len(active), bool)
        for _ in range(MAX_TRIALS):
            best = gains.argmax(axis=1)
            axes, fields = np.divmod(best, len(self._largest))
            candidate = own.copy()
            step = signs[rows, best]
            candidate[:, rows, axes] -= self._weights[:, fields] * step
            is_better = (_excess(_squares(candidate)) < before * (1 - 1e-6)) & ~has_stepped
            is_better &= gains[rows, best] > -np.inf
            improved = np.flatnonzero(is_better)
            remaining[:, active[improved]] = candidate[:, improved]
            signed = step[improved].astype(np.int32)
            integers[fields[improved], active[improved], axes[improved]] += signed
            has_stepped |= is_better
            if has_stepped.all():
                break
            gains[rows, best] = -np.inf
        return has_stepped

    def _gains(
        self, own: Singles, squares: Singles, integers: npt.NDArray[np.int32]
    ) -> tuple[Singles, Singles]:
        """Return the estimated decrease of the excess per step and its sign, of shape (N, 3 K).

        Columns are axis by axis. With ``e = max(0, |r|**2 - EXCESS_THRESHOLD)`` of a frame with
        residual ``r``, a step in a field of weight ``w`` decreases the sum of ``e**2`` by
        ``4 e r w - (4 r**2 + 2 e) w**2``.
        """
        excess = np.maximum(squares - EXCESS_THRESHOLD, 0)
        is_active = excess > 0
        gains, signs = [], []
        for axis in range(3):
            along = own[:, :, axis]
            gradient = (4 * excess * along).T @ self._weights
            curvature = (is_active * (4 * np.square(along)) + 2 * excess).T @ self._squared_weights
            sign = np.where(gradient > 0, np.float32(1), np.float32(-1))
            gain = np.abs(gradient) - curvature
            gain[np.abs(integers[:, :, axis].T + sign) > self._largest] = -np.inf
            gains.append(gain)
            signs.append(sign)
        return np.concatenate(gains, axis=1), np.concatenate(signs, axis=1)


def _squares(vectors: Singles) -> Singles:
    """Return the squared lengths of vectors of shape (..., 3)."""
    return np.asarray(np.einsum("...c,...c->...", vectors, vectors))


def _excess(squares: Singles) -> Singles:
    """Return the sum over frames of the squared excess of each vertex."""
    return np.asarray(np.square(np.maximum(squares - EXCESS_THRESHOLD, 0)).sum(axis=0))
