"""Fitting few morph targets and their weights to an animation, within a bound on every vertex.

Principal components minimize the mean error, not the maximum: a few vertices in a few frames have
large errors, and nearly twice as many components as needed would be required to reduce them.
Therefore the error of these vertices beyond the bound is added to their target positions, and the
components are computed again, some dozens of times. This is the alternating direction method of
multipliers (Boyd et al. 2011, section 9.1) for matrices of rank K within a distance of the frames.
The multipliers are bounded, since K grows meanwhile, and while it is too small, no such matrix
exists. Targets are rounded to integers in every round, so that rounding errors are compensated.

Frames are displacements from the base mesh, of shape (T, 3 V), in the units of the mesh. During the
search, x of all vertices precedes y and z, which makes NumPy three times as fast.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.codec.subspace.pca import joint_trajectories
from meshreel.formats.gltf.quantized import IntegerTargets, best_weights, integer_targets, project
from meshreel.runtime.threads import chunks, in_threads

Floats = npt.NDArray[np.float32]

INITIAL_ERROR = 8.0
"""Error of the initial components, as a multiple of the bound."""

GROWTH_DIVISOR = 100
"""Each round grows K, and later tries a smaller K, by this fraction of it, at least by one.

After growth a smaller K often suffices, since K grows faster than the positions converge."""

PATIENCE = 8
"""Failed rounds before the search for a smaller number of targets stops."""

POSITION_SHARE = 0.9
"""Fraction of the bound at which positions aim."""

ROUNDING_SHARE = 0.15
"""Mean rounding error of int8 targets, as a fraction of the bound; nearly all are below half."""

INITIAL_AIM, NEXT_AIM = 0.35, 0.75
"""Error at which a fixed number of targets aims: as a fraction of that of the components, and then
of the smallest so far."""

MAX_ROUNDS, MAX_FIXED_ROUNDS = 60, 24
PIECE_FRAMES = 8


@dataclass(frozen=True, eq=False)
class Morphs:
    """Morph targets, weights and errors.

    Attributes
    ----------
    targets : IntegerTargets
    weights : float32 array of shape (T, K)
    errors : float32 array of shape (T,)
        Largest error of a vertex in each frame.
    """

    targets: IntegerTargets
    weights: Floats
    errors: Floats

    @property
    def error(self) -> float:
        """Largest error of a vertex in all frames."""
        return float(self.errors.max())


def fit_morphs(displacements: Floats, bound: float) -> Morphs:
    """Return few targets with which no vertex has an error above `bound`.

    If int16 is too coarse for the bound, return those with the smallest error found.
    """
    by_axes = _axes_first(displacements)
    search = _Search(by_axes)
    n_initial = _initial_count(by_axes, INITIAL_ERROR * bound)
    best = _grow(search, n_initial, min(displacements.shape), bound)
    n_failed = 0
    while best.error <= bound and n_failed < PATIENCE and len(best.targets) > 1:
        n_targets = len(best.targets) - max(1, len(best.targets) // GROWTH_DIVISOR)
        morphs = search.round(n_targets, bound)
        best, n_failed = (morphs, 0) if morphs.error <= bound else (best, n_failed + 1)
    return _vertices_first(best)


def _grow(search: "_Search", n_targets: int, max_targets: int, bound: float) -> Morphs:
    """Return targets that meet the bound, from a smaller number that grows in each round."""
    best = search.round(n_targets, bound)
    for number in range(MAX_ROUNDS):
        if best.error <= bound or n_targets == max_targets:
            break
        n_targets += max(1, n_targets // GROWTH_DIVISOR)
        is_last = number == MAX_ROUNDS - 1
        n_targets = max_targets if is_last else min(n_targets, max_targets)
        morphs = search.round(n_targets, bound)
        best = min(best, morphs, key=lambda one: one.error)
    return best


def fit_fixed_morphs(displacements: Floats, n_targets: int, bound: float) -> Morphs:
    """Return `n_targets` targets with the smallest error found, or with one below `bound`."""
    search = _Search(_axes_first(displacements))
    best = search.round(min(n_targets, *displacements.shape), bound)
    aim = INITIAL_AIM * best.error
    for _ in range(MAX_FIXED_ROUNDS):
        if best.error <= bound or len(best.targets) < n_targets:  # fewer targets are exact
            break
        morphs = search.round(n_targets, max(bound, aim))
        best = min(best, morphs, key=lambda one: one.error)
        aim = min(aim, NEXT_AIM * best.error) if best.error <= aim else aim
    return _vertices_first(best)


def measure(targets: IntegerTargets, weights: Floats, displacements: Floats) -> Morphs:
    """Return targets and weights with their errors."""
    errors = np.empty(len(displacements), np.float32)

    def compare(frames: slice) -> None:
        residuals = _axes_first(displacements[frames] - weights[frames] @ targets.values)
        errors[frames] = _lengths(residuals).max(axis=1)

    in_threads(compare, chunks(len(displacements), PIECE_FRAMES))
    return Morphs(targets, weights, errors)


class _Search:
    """Target displacements, updated round by round."""

    def __init__(self, displacements: Floats) -> None:
        self._displacements = displacements
        self._aims = displacements.copy()
        self._excess = np.zeros_like(displacements)

    def round(self, n_targets: int, bound: float) -> Morphs:
        """Return morph targets for the current aims, and update these by the excess error."""
        _, time_vectors = joint_trajectories(self._aims[None], n_targets)
        max_weights = np.abs(time_vectors).max(axis=0)
        fields = project(time_vectors.astype(np.float32), self._aims)
        targets = integer_targets(fields, max_weights, ROUNDING_SHARE * bound)
        weights = best_weights(targets, self._aims)
        errors = np.empty(len(self._displacements), np.float32)

        def update(frames: slice) -> None:
            errors[frames] = self._update(frames, weights[frames] @ targets.values, bound)

        in_threads(update, chunks(len(self._displacements), PIECE_FRAMES))
        return Morphs(targets, weights, errors)

    def _update(self, frames: slice, decoded: Floats, bound: float) -> Floats:
        """Update aims and excess of some frames, and return the largest error of each."""
        displacements, excess = self._displacements[frames], self._excess[frames]
        residuals = displacements - decoded
        errors: Floats = _lengths(residuals).max(axis=1)
        residuals += excess
        distances = np.maximum(_lengths(residuals), np.finfo(np.float32).tiny)
        within = _scaled(residuals, np.minimum(1, POSITION_SHARE * bound / distances))
        residuals -= within
        beyond = np.maximum(distances - POSITION_SHARE * bound, 1e-30)
        residuals = _scaled(residuals, np.minimum(1, bound / beyond))
        excess[:] = residuals
        self._aims[frames] = displacements - within + excess
        return errors


def _axes_first(displacements: Floats) -> Floats:
    """Return displacements of shape (T, 3 V), reordered from vertex by vertex to axis by axis."""
    by_vertices = displacements.reshape(len(displacements), -1, 3)
    return np.ascontiguousarray(by_vertices.transpose(0, 2, 1)).reshape(displacements.shape)


def _vertices_first(morphs: Morphs) -> Morphs:
    """Return morphs with targets reordered from axis by axis to vertex by vertex."""
    integers = morphs.targets.integers
    by_vertices = integers.reshape(len(integers), 3, -1).transpose(0, 2, 1)
    ordered = np.ascontiguousarray(by_vertices).reshape(integers.shape)
    return replace(morphs, targets=replace(morphs.targets, integers=ordered))


def _lengths(displacements: Floats) -> Floats:
    """Return lengths of displacements in axis order, of shape (T, V)."""
    by_axes = displacements.reshape(len(displacements), 3, -1)
    x, y, z = (axis for axis in by_axes.swapaxes(0, 1))
    squares = x * x
    squares += y * y
    squares += z * z
    return np.asarray(np.sqrt(squares, out=squares))


def _scaled(displacements: Floats, factors: Floats) -> Floats:
    """Return displacements in axis order times factors of shape (T, V)."""
    by_axes = displacements.reshape(len(displacements), 3, -1)
    return np.asarray(by_axes * factors[:, np.newaxis]).reshape(displacements.shape)


def _initial_count(displacements: Floats, error: float) -> int:
    """Return the smallest number of components with all errors up to `error`."""
    _, time_vectors = joint_trajectories(displacements[None], min(displacements.shape))
    weights = time_vectors.astype(np.float32)
    fields = project(weights, displacements)
    low, high = 1, weights.shape[1]
    while low < high:
        middle = (low + high) // 2
        if _is_within(displacements, weights[:, :middle], fields[:middle], error):
            high = middle
        else:
            low = middle + 1
    return low


def _is_within(displacements: Floats, weights: Floats, fields: Floats, error: float) -> bool:
    exceeding: list[slice] = []

    def compare(frames: slice) -> None:
        if not exceeding:
            residuals = displacements[frames] - weights[frames] @ fields
            if _lengths(residuals).max() > error:
                exceeding.append(frames)

    in_threads(compare, chunks(len(displacements), PIECE_FRAMES))
    return not exceeding
