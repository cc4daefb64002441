"""Digits of vertices that are off too far, changed one by one.

With weights given, a vertex does not depend on others: three rows of integers are to be found for
it with which no frame is off beyond the bound. From the nearest ones, a step of one in one integer
is taken again and again, which makes the squares of what frames are off beyond nearly the bound
smaller, most of all by its second-order estimate; until no frame is off too far, or no step helps.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Singles
from meshreel.formats.vat.pca.digits import Fields, largest_integer
from meshreel.runtime.threads import chunks, in_threads

NEARLY = np.float32(0.85)
"""Squared distances beyond this share of the squared bound count."""

INSIDE = 0.9995
"""Share of the bound that is aimed at, so that rounding keeps the bound itself."""

STEPS, TRIES = 40, 3
"""Steps of a vertex, and how many of the best estimates are tried for each."""

AT_ONCE, MISSES_AT_ONCE = 96, 1024

FEW, STARTS, SHAKEN, SEED = 4, 64, 0.1, 1
"""Vertices of a piece that are tried again from other integers, from how many others, what share of
these is changed by one, and what random numbers begin with."""


@dataclass(frozen=True, eq=False)
class Misses:
    """How far vertices are off.

    Attributes
    ----------
    vectors : float32 array of shape (T, V, 3)
        From where fields move a vertex to where it should be.
    """

    vectors: Singles

    @classmethod
    def of(cls, moves: Singles, fields: Fields) -> "Misses":
        """Those of fields, for displacements of shape (T, 3 V)."""
        vectors = np.empty((len(moves), moves.shape[1] // 3, 3), np.float32)

        def subtract(verts: slice) -> None:
            columns = slice(3 * verts.start, 3 * verts.stop)
            made = fields.weights @ fields.integers[:, columns].astype(np.float32)
            vectors[:, verts] = (moves[:, columns] - made).reshape(len(moves), -1, 3)

        in_threads(subtract, chunks(vectors.shape[1], MISSES_AT_ONCE))
        return cls(vectors)

    def distances(self) -> Singles:
        """The largest of each vertex, of shape (V,)."""
        return np.asarray(np.sqrt(_squares(self.vectors).max(axis=0)))

    @property
    def error(self) -> float:
        """The largest of all."""
        return float(self.distances().max())


def repaired(fields: Fields, misses: Misses, bound: float) -> tuple[Fields, npt.NDArray[np.int64]]:
    """The fields with integers changed to keep the bound, and the vertices that are still off.

    The vertices that are off furthest are tried first; once some are lost, others are not tried.

    Parameters
    ----------
    fields : Fields
    misses : Misses
        Of these fields.
    bound : float
    """
    distances = misses.distances()
    wrong = np.flatnonzero(distances > INSIDE * bound)
    wrong = wrong[np.argsort(-distances[wrong], kind="stable")]
    integers = fields.integers.reshape(len(fields.integers), -1, 3).copy()
    pieces = [wrong[piece] for piece in chunks(len(wrong), AT_ONCE)]
    steps = _Steps(fields.weights, largest_integer(fields.n_digits), bound)
    lost: list[int] = []

    def repair(verts: npt.NDArray[np.int64]) -> None:
        if not lost:
            own = integers[:, verts]
            own_misses = misses.vectors[:, verts]
            is_lost = steps.take(own, own_misses)
            if is_lost.sum() <= FEW:
                for place in np.flatnonzero(is_lost):
                    start, miss = integers[:, verts[place]], own_misses[:, place]
                    if (found := steps.take_shaken(start, miss)) is not None:
                        own[:, place], is_lost[place] = found, False
            lost.extend(verts[is_lost])
            integers[:, verts] = own

    repair(pieces[0])  # the furthest, alone: where some of these are lost, the others are no use
    in_threads(repair, pieces[1:])
    changed = Fields(integers.reshape(fields.integers.shape), fields.weights, fields.n_digits)
    return changed, np.array(sorted(lost), np.int64)


class _Steps:
    """Steps of integers for vertices of any number.

    Parameters
    ----------
    weights : float32 array of shape (T, K)
    largest : int64 array of shape (K,)
        Of the integers.
    bound : float
    """

    def __init__(self, weights: Singles, largest: npt.NDArray[np.int64], bound: float) -> None:
        # In bounds, so that 1 is what is allowed.
        self._weights = weights / np.float32(INSIDE * bound)
        self._squared_weights = np.square(self._weights)
        self._largest, self._unit = largest, np.float32(INSIDE * bound)

    def take(self, integers: npt.NDArray[np.int32], misses: Singles) -> npt.NDArray[np.bool_]:
        """Change the integers of vertices, of shape (K, N, 3); which are still off too far.

        Parameters
        ----------
        integers : int32 array of shape (K, N, 3)
        misses : float32 array of shape (T, N, 3)
        """
        left = misses / self._unit
        live = np.arange(left.shape[1])
        for _ in range(STEPS):
            squares = _squares(left[:, live])
            is_off = squares.max(axis=0) > 1
            live, squares = live[is_off], squares[:, is_off]
            if not len(live):
                break
            live = live[self._step(integers, left, live, squares)]
        return np.asarray(_squares(left).max(axis=0) > 1)

    def take_shaken(
        self, integers: npt.NDArray[np.int32], misses: Singles
    ) -> npt.NDArray[np.int32] | None:
        """Integers of one vertex, of shape (K, 3), with which it is not off too far, or None.

        Steps are taken from many starts, each with other integers changed by one at random.

        Parameters
        ----------
        integers : int32 array of shape (K, 3)
        misses : float32 array of shape (T, 3)
        """
        rng = np.random.default_rng(SEED)
        shape = (len(integers), STARTS, 3)
        shakes = rng.choice([-1, 0, 1], shape, p=[SHAKEN / 2, 1 - SHAKEN, SHAKEN / 2])
        largest = self._largest[:, None, None]
        starts = np.clip(integers[:, None] + shakes, -largest, largest).astype(np.int32)
        changed = (starts - integers[:, None]).reshape(len(integers), -1).astype(np.float32)
        moved = (self._weights * self._unit @ changed).reshape(-1, STARTS, 3)
        found = np.flatnonzero(~self.take(starts, misses[:, None] - moved))
        return starts[:, found[0]] if len(found) else None

    def _step(
        self,
        integers: npt.NDArray[np.int32],
        left: Singles,
        live: npt.NDArray[np.int64],
        squares: Singles,
    ) -> npt.NDArray[np.bool_]:
        """Take one step of each vertex that has one that helps; which have."""
        own = left[:, live]
        before = _excess(squares)
        gains, signs = self._gains(own, squares, integers[:, live])
        rows = np.arange(len(live))
        has_stepped = np.zeros(len(live), bool)
        for _ in range(TRIES):
            best = gains.argmax(axis=1)
            axes, fields = np.divmod(best, len(self._largest))
            tried = own.copy()
            step = signs[rows, best]
            tried[:, rows, axes] -= self._weights[:, fields] * step
            is_better = (_excess(_squares(tried)) < before * (1 - 1e-6)) & ~has_stepped
            is_better &= gains[rows, best] > -np.inf
            now = np.flatnonzero(is_better)
            left[:, live[now]] = tried[:, now]
            integers[fields[now], live[now], axes[now]] += step[now].astype(np.int32)
            has_stepped |= is_better
            if has_stepped.all():
                break
            gains[rows, best] = -np.inf
        return has_stepped

    def _gains(
        self, own: Singles, squares: Singles, integers: npt.NDArray[np.int32]
    ) -> tuple[Singles, Singles]:
        """How much smaller the excess gets by a step, and its sign: shape (N, 3 K), axis by axis.

        With ``e`` the excess ``max(0, |m|**2 - NEARLY)`` of a frame, a step of a field of weight
        ``w`` takes ``4 e m w - (4 m**2 + 2 e) w**2`` from the sum of ``e**2``.
        """
        excess = np.maximum(squares - NEARLY, 0)
        is_on = excess > 0
        gains, signs = [], []
        for axis in range(3):
            along = own[:, :, axis]
            slope = (4 * excess * along).T @ self._weights
            bend = (is_on * (4 * np.square(along)) + 2 * excess).T @ self._squared_weights
            sign = np.where(slope > 0, np.float32(1), np.float32(-1))
            gain = np.abs(slope) - bend
            gain[np.abs(integers[:, :, axis].T + sign) > self._largest] = -np.inf
            gains.append(gain)
            signs.append(sign)
        return np.concatenate(gains, axis=1), np.concatenate(signs, axis=1)


def _squares(vectors: Singles) -> Singles:
    """Squared lengths of vectors of shape (..., 3)."""
    return np.asarray(np.einsum("...c,...c->...", vectors, vectors))


def _excess(squares: Singles) -> Singles:
    """What each vertex is off, in all frames: sum over those beyond nearly the bound."""
    return np.asarray(np.square(np.maximum(squares - NEARLY, 0)).sum(axis=0))
