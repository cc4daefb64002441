"""Search for fields and weights with few texels, with all vertices within an error bound.

Principal components minimize the mean error, and digits are allocated so that the mean error of
truncation and rounding together is smallest. To minimize the largest error instead, every round

- adds the error of a vertex beyond the bound to its target (the method of multipliers, as in
  `meshreel.formats.gltf.morphs`),
- increases the weights of vertices beyond the bound in the PCA.

Then integers of vertices that still exceed the bound are changed one by one
(`meshreel.formats.vat.pca.repair`). If that fails, every coordinate gains a texel.

Displacements are relative to the rest mesh, of shape (T, 3 V), in model units.
"""

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles
from meshreel.codec.subspace.least_squares import solve_gram
from meshreel.codec.subspace.pca import gram_of_rows, leading_trajectories
from meshreel.formats.gltf.quantized import project
from meshreel.formats.vat.pca.digits import (
    DIGITS_PER_TEXEL,
    MAX_DIGITS,
    Fields,
    allocate_digits,
    largest_integer,
    min_texels,
)
from meshreel.formats.vat.pca.repair import Residuals, repair
from meshreel.runtime.progress import Progress
from meshreel.runtime.threads import chunks, in_threads

INITIAL_RMS = 0.42
"""Root mean square error that selects the initial number of texels, as a fraction of the bound."""

TARGET_SHARE = 0.85
"""Target of each round, as a fraction of the bound; rounding to digits needs the rest."""

POSITION_SHARE = 0.9
"""Target of a single position, as a fraction of the target of the round."""

MAX_WEIGHTED_ERROR, WEIGHT_EXPONENT = 4.0, 0.6
"""In every round, the weight of a vertex is multiplied by its error in bounds, clipped to this
maximum, raised to this exponent."""

FAILED_WEIGHT = 2.0
"""Factor on the weights of vertices that could not be repaired."""

MAX_ROUNDS, FIRST_REPAIR, REPAIR_INTERVAL = 18, 6, 4
"""Rounds per number of texels, the first round with a repair, and rounds between repairs."""

MAX_REPAIRABLE_ERROR, MAX_FIRST_ERROR = 1.8, 2.5
"""Errors, in bounds. A repair is tried up to the first one; the search for this number of texels
ends if the error at the first repair exceeds the second one."""

PIECE_VERTS = 1024


def fit_fields(displacements: Singles, bound: float, progress: Progress) -> Fields | None:
    """Return fields that meet the bound in few texels, or None if five digits are too coarse.

    Parameters
    ----------
    displacements : float32 array of shape (T, 3 V)
    bound : float
        Above 0.
    progress : Progress
        Called for every round.
    """
    if Residuals.of(displacements, empty := _no_fields(displacements)).error <= bound:
        return empty
    search = _Search(displacements, bound)
    max_texels = -(-MAX_DIGITS * min(displacements.shape) // DIGITS_PER_TEXEL)
    n_texels = min(search.first_texels(), max_texels)
    fields = search.fit(n_texels, progress)
    if fields is not None:
        while n_texels > 1 and (fewer := search.fit(n_texels - 1, progress)) is not None:
            fields, n_texels = fewer, n_texels - 1
        return fields
    while fields is None and n_texels < max_texels:
        n_texels = min(max_texels, n_texels + max(1, n_texels // 16))
        fields = search.fit(n_texels, progress)
    return fields


def _no_fields(displacements: Singles) -> Fields:
    n_frames, size = displacements.shape
    weights = np.zeros((n_frames, 0), np.float32)
    return Fields(np.zeros((0, size), np.int32), weights, np.zeros(0, np.int64))


def fit_rms(displacements: Singles, rms_error: float) -> Fields:
    """Return fields in the fewest texels that meet a root mean square error of vertices."""
    size = displacements.shape[1]
    gram = gram_of_rows(lambda piece: displacements[:, piece], *displacements.shape)
    values, vectors = leading_trajectories(gram, min(displacements.shape))
    components = project(vectors.astype(np.float32), displacements)
    coefficients = _rounding_coefficients(components)
    n_texels = min_texels(values**2, coefficients, rms_error**2 * displacements.size / 3)
    n_digits = allocate_digits(values**2, coefficients, n_texels)
    return quantize_fields(components, n_digits, displacements, np.ones(size // 3, np.float32))


class _Search:
    """Targets and weights of vertices, updated round by round."""

    def __init__(self, displacements: Singles, bound: float) -> None:
        self._displacements, self._bound = displacements, bound
        self._targets = displacements.copy()
        self._excess = np.zeros_like(displacements)
        self._weights = np.ones(displacements.shape[1] // 3, np.float32)

    def first_texels(self) -> int:
        """Return the number of texels to start with."""
        energies, components = self._components()
        allowed = (INITIAL_RMS * self._bound) ** 2 * self._displacements.size / 3
        return max(1, min_texels(energies, _rounding_coefficients(components), allowed))

    def fit(self, n_texels: int, progress: Progress) -> Fields | None:
        """Return fields with `n_texels` texels that meet the bound, or None."""
        for number in range(1, MAX_ROUNDS + 1):
            progress(f"{n_texels} texels per coordinate", number / MAX_ROUNDS)
            fields, residuals = self._round(n_texels)
            error = residuals.error / self._bound
            if error <= 1:
                return fields
            if number >= FIRST_REPAIR and (number - FIRST_REPAIR) % REPAIR_INTERVAL == 0:
                limit = MAX_FIRST_ERROR if number == FIRST_REPAIR else MAX_REPAIRABLE_ERROR
                if error > limit:
                    break
                if error > MAX_REPAIRABLE_ERROR:
                    continue
                repaired, failed = repair(fields, residuals, self._bound)
                if not len(failed):
                    return repaired
                self._weights[failed] *= FAILED_WEIGHT
        return None

    def _components(self) -> tuple[Floats, Singles]:
        """Return the energies of the weighted principal components, and the components."""
        weights = np.repeat(self._weights, 3)
        targets = self._targets
        gram = gram_of_rows(lambda piece: targets[:, piece] * weights[piece], *targets.shape)
        values, vectors = leading_trajectories(gram, min(targets.shape))
        return values**2, project(vectors.astype(np.float32), targets)

    def _round(self, n_texels: int) -> tuple[Fields, Residuals]:
        """Return fields for the current targets and their residuals, and update the targets."""
        energies, components = self._components()
        n_digits = allocate_digits(energies, _rounding_coefficients(components), n_texels)
        fields = quantize_fields(components, n_digits, self._targets, self._weights)
        residuals = Residuals.of(self._displacements, fields)
        in_threads(
            lambda verts: self._update(verts, residuals.vectors[:, verts]),
            chunks(len(self._weights), PIECE_VERTS),
        )
        self._weights /= np.sqrt(np.mean(np.square(self._weights)))
        return fields, residuals

    def _update(self, verts: slice, residuals: Singles) -> None:
        """Update the targets and weights of some vertices from their residuals."""
        columns = slice(3 * verts.start, 3 * verts.stop)
        target_error = np.float32(TARGET_SHARE * self._bound)
        position_error = np.float32(POSITION_SHARE) * target_error
        errors = np.sqrt(_squares(residuals).max(axis=0)) / self._bound
        self._weights[verts] *= np.clip(errors, 1, MAX_WEIGHTED_ERROR) ** WEIGHT_EXPONENT
        excess = self._excess[:, columns].reshape(residuals.shape)
        beyond = residuals + excess
        distances = np.maximum(np.sqrt(_squares(beyond)), np.finfo(np.float32).tiny)[..., None]
        within = np.minimum(1, position_error / distances) * beyond
        beyond -= within
        beyond *= np.minimum(1, target_error / np.maximum(distances - position_error, 1e-30))
        flat = (len(residuals), -1)
        self._excess[:, columns] = beyond.reshape(flat)
        self._targets[:, columns] = self._displacements[:, columns] + (beyond - within).reshape(
            flat
        )


def _rounding_coefficients(components: Singles) -> Floats:
    """Return the squared rounding error of each component times ``(15**n - 1)**2``."""
    peaks = np.abs(components).max(axis=1).astype(np.float64)
    return np.asarray(peaks**2 * (components.shape[1] / 3))


def quantize_fields(
    components: Singles, n_digits: npt.NDArray[np.int64], targets: Singles, vertex_weights: Singles
) -> Fields:
    """Return components rounded to their digits, with optimal weights by least squares.

    Parameters
    ----------
    components : float32 array of shape (K, 3 V)
    n_digits : int64 array of shape (K,)
        Digits of each component; components without digits are dropped.
    targets : float32 array of shape (T, 3 V)
        Displacements to approximate.
    vertex_weights : float32 array of shape (V,)
        Weights of the errors of vertices.
    """
    kept = np.flatnonzero(n_digits)
    largest = largest_integer(n_digits[kept])
    peaks = np.abs(components[kept]).max(axis=1)
    scales = (largest / np.where(peaks > 0, peaks, 1)).astype(np.float32)
    integers = np.empty((len(kept), components.shape[1]), np.int32)
    gram = np.zeros((len(kept), len(kept)))
    products = np.zeros((len(kept), len(targets)))
    pieces = chunks(len(vertex_weights), PIECE_VERTS)
    parts: list[tuple[Floats, Floats]] = [(gram, products)] * len(pieces)

    def add(number: int) -> None:
        verts = pieces[number]
        columns = slice(3 * verts.start, 3 * verts.stop)
        rounded = np.rint(components[kept, columns] * scales[:, None])
        integers[:, columns] = rounded
        # In the scale of the components, for a well-conditioned system.
        values = rounded / scales[:, None]
        weighted = values * np.repeat(np.square(vertex_weights[verts]), 3)
        parts[number] = (
            (weighted @ values.T).astype(np.float64),
            (weighted @ targets[:, columns].T).astype(np.float64),
        )

    in_threads(add, range(len(pieces)))
    for part_gram, part_products in parts:  # in order, so that sums do not depend on threads
        gram += part_gram
        products += part_products
    weights = solve_gram(gram, products).T / scales
    return Fields(integers, np.ascontiguousarray(weights, np.float32), n_digits[kept])


def _squares(vectors: Singles) -> Singles:
    """Return the squared lengths of vectors of shape (..., 3)."""
    return np.asarray(np.einsum("...c,...c->...", vectors, vectors))
