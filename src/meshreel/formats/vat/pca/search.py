"""Fields and weights in as few texels as are found, with no vertex off by more than a bound.

Principal components have the least mean error, and digits are shared among them so that rounding
and what is left out have the least mean error together. But the largest error is to be small, so in
every round

- what a vertex is off beyond the bound is added to where it is to go (the method of multipliers, as
  `meshreel.formats.gltf.morphs` has it),
- vertices that are off too far count for more in the components, which are few numbers a frame and
  the same for all vertices.

Then digits of vertices that are still off too far are changed one by one
(`meshreel.formats.vat.pca.repair`). Where that is not enough, there is a texel more for each
coordinate of each vertex.

Frames are displacements from the mesh at rest, of shape (T, 3 V); lengths have their units.
"""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles
from meshreel.codec.subspace.least_squares import solve_gram
from meshreel.codec.subspace.pca import gram_of_rows, leading_trajectories
from meshreel.formats.gltf.quantized import project
from meshreel.formats.vat.pca.digits import (
    MOST_DIGITS,
    ROWS,
    Fields,
    largest_integer,
    shared_digits,
    texels_for,
)
from meshreel.formats.vat.pca.repair import Misses, repaired
from meshreel.runtime.progress import Progress
from meshreel.runtime.threads import chunks, in_threads

FIRST_NOISE = 0.42
"""Root mean square error, by the bound, of the texels that the search begins with."""

AIMED = 0.85
"""Share of the bound that rounds aim at; rounding to digits needs the rest."""

NARROWED = 0.9
"""Positions aim at this share of what rounds aim at."""

MOST_WEIGHED, WEIGHING = 4.0, 0.6
"""An error of so many bounds, and no more, counts for a vertex; to this power, in every round."""

LOST_WEIGHING = 2.0
"""So much more count those that could not be repaired."""

ROUNDS, FIRST_REPAIR, REPAIR_EVERY = 18, 6, 4
"""Rounds with a number of texels; the first one after which digits are repaired, and how often."""

REPAIRABLE, HOPEFUL = 1.8, 2.5
"""Errors of more bounds than that are not worth repairing, and then need more texels; at first they
may be a little larger."""

VERTICES_AT_ONCE = 1024


def fit_fields(moves: Singles, bound: float, progress: Progress) -> Fields | None:
    """Fields that keep the bound in as few texels as are found; None if none do.

    Parameters
    ----------
    moves : float32 array of shape (T, 3 V)
    bound : float
        Above 0.
    progress : Progress
        Told of the rounds.
    """
    if Misses.of(moves, none := _no_fields(moves)).error <= bound:
        return none
    search = _Search(moves, bound)
    most = -(-MOST_DIGITS * min(moves.shape) // ROWS)
    n_texels = min(search.first_texels(), most)
    found = search.fit(n_texels, progress)
    if found is not None:
        while n_texels > 1 and (fewer := search.fit(n_texels - 1, progress)) is not None:
            found, n_texels = fewer, n_texels - 1
        return found
    while found is None and n_texels < most:
        n_texels = min(most, n_texels + max(1, n_texels // 16))
        found = search.fit(n_texels, progress)
    return found


def _no_fields(moves: Singles) -> Fields:
    n_frames, size = moves.shape
    weights = np.zeros((n_frames, 0), np.float32)
    return Fields(np.zeros((0, size), np.int32), weights, np.zeros(0, np.int64))


def fit_mean(moves: Singles, error: float) -> Fields:
    """Fields in as few texels as leave this root mean square error of vertices."""
    size = moves.shape[1]
    gram = gram_of_rows(lambda piece: moves[:, piece], *moves.shape)
    values, vectors = leading_trajectories(gram, min(moves.shape))
    fields = project(vectors.astype(np.float32), moves)
    steps = _steps(fields)
    n_texels = texels_for(values**2, steps, error**2 * moves.size / 3)
    n_digits = shared_digits(values**2, steps, n_texels)
    return _rounded(fields, n_digits, moves, np.ones(size // 3, np.float32))


class _Search:
    """Where vertices are to go and how much they count, round by round."""

    def __init__(self, moves: Singles, bound: float) -> None:
        self._moves, self._bound = moves, bound
        self._aims = moves.copy()
        self._excess = np.zeros_like(moves)
        self._counts = np.ones(moves.shape[1] // 3, np.float32)

    def first_texels(self) -> int:
        """The number to begin with."""
        energies, fields = self._components()
        allowed = (FIRST_NOISE * self._bound) ** 2 * self._moves.size / 3
        return max(1, texels_for(energies, _steps(fields), allowed))

    def fit(self, n_texels: int, progress: Progress) -> Fields | None:
        """Fields of so many texels within the bound, or None."""
        for number in range(1, ROUNDS + 1):
            progress(f"{n_texels} texels a coordinate", number / ROUNDS)
            fields, misses = self._round(n_texels)
            error = misses.error / self._bound
            if error <= 1:
                return fields
            if number >= FIRST_REPAIR and (number - FIRST_REPAIR) % REPAIR_EVERY == 0:
                if error > (HOPEFUL if number == FIRST_REPAIR else REPAIRABLE):
                    break
                if error > REPAIRABLE:
                    continue
                better, lost = repaired(fields, misses, self._bound)
                if not len(lost):
                    return better
                self._counts[lost] *= LOST_WEIGHING
        return None

    def _components(self) -> tuple[Floats, Singles]:
        """Energies of the weighed components, and the field of each."""
        counts = np.repeat(self._counts, 3)
        gram = gram_of_rows(lambda piece: self._aims[:, piece] * counts[piece], *self._aims.shape)
        values, vectors = leading_trajectories(gram, min(self._aims.shape))
        return values**2, project(vectors.astype(np.float32), self._aims)

    def _round(self, n_texels: int) -> tuple[Fields, Misses]:
        """Fields for where vertices are to go now, and how far off these are."""
        energies, components = self._components()
        n_digits = shared_digits(energies, _steps(components), n_texels)
        fields = _rounded(components, n_digits, self._aims, self._counts)
        misses = Misses.of(self._moves, fields)
        in_threads(
            lambda verts: self._correct(verts, misses.vectors[:, verts]),
            chunks(len(self._counts), VERTICES_AT_ONCE),
        )
        self._counts /= np.sqrt(np.mean(np.square(self._counts)))
        return fields, misses

    def _correct(self, verts: slice, misses: Singles) -> None:
        """Set where some vertices are to go next, and how much they count."""
        columns = slice(3 * verts.start, 3 * verts.stop)
        aimed = np.float32(AIMED * self._bound)
        narrow = np.float32(NARROWED) * aimed
        errors = np.sqrt(_squares(misses).max(axis=0)) / self._bound
        self._counts[verts] *= np.clip(errors, 1, MOST_WEIGHED) ** WEIGHING
        excess = self._excess[:, columns].reshape(misses.shape)
        beyond = misses + excess
        distances = np.maximum(np.sqrt(_squares(beyond)), np.finfo(np.float32).tiny)[..., None]
        within = np.minimum(1, narrow / distances) * beyond
        beyond -= within
        beyond *= np.minimum(1, aimed / np.maximum(distances - narrow, 1e-30))
        flat = (len(misses), -1)
        self._excess[:, columns] = beyond.reshape(flat)
        self._aims[:, columns] = self._moves[:, columns] + (beyond - within).reshape(flat)


def _steps(fields: Singles) -> Floats:
    """Sum of squared rounding errors of each field times ``(15**n - 1)**2``."""
    peaks = np.abs(fields).max(axis=1).astype(np.float64)
    return np.asarray(peaks**2 * (fields.shape[1] / 3))


def _rounded(
    components: Singles, n_digits: npt.NDArray[np.int64], aims: Singles, counts: Singles
) -> Fields:
    """Fields rounded to their digits, and the best weights for them by least squares.

    Parameters
    ----------
    components : float32 array of shape (K, 3 V)
    n_digits : int64 array of shape (K,)
        Fields without digits are left out.
    aims : float32 array of shape (T, 3 V)
        What the fields are to add up to.
    counts : float32 array of shape (V,)
        How much an error of each vertex counts.
    """
    own = np.flatnonzero(n_digits)
    largest = largest_integer(n_digits[own])
    peaks = np.abs(components[own]).max(axis=1)
    scales = (largest / np.where(peaks > 0, peaks, 1)).astype(np.float32)
    integers = np.empty((len(own), components.shape[1]), np.int32)
    gram = np.zeros((len(own), len(own)))
    products = np.zeros((len(own), len(aims)))
    pieces = chunks(len(counts), VERTICES_AT_ONCE)
    parts: list[tuple[Floats, Floats]] = [(gram, products)] * len(pieces)

    def add(number: int) -> None:
        verts = pieces[number]
        columns = slice(3 * verts.start, 3 * verts.stop)
        rounded = np.rint(components[own, columns] * scales[:, None])
        integers[:, columns] = rounded
        # In the scale of the components, so that the equations are near the unit matrix.
        values = rounded / scales[:, None]
        weighed = values * np.repeat(np.square(counts[verts]), 3)
        parts[number] = (
            (weighed @ values.T).astype(np.float64),
            (weighed @ aims[:, columns].T).astype(np.float64),
        )

    in_threads(add, range(len(pieces)))
    for own_gram, own_products in parts:  # in order, so that the sums are the same on every machine
        gram += own_gram
        products += own_products
    weights = solve_gram(gram, products).T / scales
    return Fields(integers, np.ascontiguousarray(weights, np.float32), n_digits[own])


def _squares(vectors: Singles) -> Singles:
    """Squared lengths of vectors of shape (..., 3)."""
    return np.asarray(np.einsum("...c,...c->...", vectors, vectors))
