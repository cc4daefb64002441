"""An animation as few morph targets and their weights, within an error that no vertex exceeds.

Principal components have the least mean error, not the least maximum: a few vertices in a few
frames are far off, and to bring them close takes nearly twice as many targets as needed. So what
these vertices are off beyond the bound is added to where they are to go, and the components are
found again, some dozens of times. That is the alternating direction method of multipliers
(Boyd et al. 2011, section 9.1) for the matrices of rank K within a distance of the frames; the
multipliers are bounded, for K grows meanwhile, and before it is large enough there is no such
matrix. Targets are rounded to integers in every round: what that costs is known, and made up for.

Frames are displacements from the base mesh, of shape (T, 3 V); lengths have their units. While
targets are looked for, x of all vertices comes before y and z: NumPy is three times as fast then.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.codec.subspace.pca import joint_trajectories
from meshreel.formats.gltf.quantized import IntegerTargets, best_weights, integer_targets, project
from meshreel.runtime.threads import chunks, in_threads

Floats = npt.NDArray[np.float32]

START = 8.0
"""Error of the components to begin with, by the bound."""

ONE_OF = 100
"""K grows, and is then tried smaller, by one for each so many that there are, and by one at least.

Once it is large enough a smaller one often is too, for in a round K grows faster than vertices
settle."""

PATIENCE = 8
"""Rounds that a smaller number of targets is given."""

NARROWED = 0.9
"""Positions aim at this share of the bound."""

NOISE = 0.15
"""Share of the bound that rounding to int8 may be off in the mean; nearly all stays below half."""

FIRST_AIM, NEXT_AIM = 0.35, 0.75
"""Error that a given number of targets aims at, by that of the components; by the least so far."""

ROUNDS, GIVEN_ROUNDS = 60, 24
FRAMES_AT_ONCE = 8


@dataclass(frozen=True, eq=False)
class Morphs:
    """Targets and weights, and how far off they are.

    Attributes
    ----------
    weights : float32 array of shape (T, K)
    errors : float32 array of shape (T,)
        Of the vertex that is off the furthest, in each frame.
    """

    targets: IntegerTargets
    weights: Floats
    errors: Floats

    @property
    def error(self) -> float:
        """Distance of the vertex that is off the furthest in all frames."""
        return float(self.errors.max())


def fit_morphs(moves: Floats, bound: float) -> Morphs:
    """As few targets as are found with which no vertex is off by more than `bound`.

    Where rounding to int16 is too coarse for that, those with the least error that was found.
    """
    by_axes = _axes_first(moves)
    search = _Search(by_axes)
    best = _grow(search, _start(by_axes, START * bound), min(moves.shape), bound)
    n_failed = 0
    while best.error <= bound and n_failed < PATIENCE and len(best.targets) > 1:
        n_targets = len(best.targets) - max(1, len(best.targets) // ONE_OF)
        found = search.round(n_targets, bound)
        best, n_failed = (found, 0) if found.error <= bound else (best, n_failed + 1)
    return _vertices_first(best)


def _grow(search: "_Search", n_targets: int, n_most: int, bound: float) -> Morphs:
    """Targets that keep the bound, from a number that does not; more of them in each round."""
    best = search.round(n_targets, bound)
    for number in range(ROUNDS):
        if best.error <= bound or n_targets == n_most:
            break
        n_targets += max(1, n_targets // ONE_OF)
        n_targets = n_most if number == ROUNDS - 1 else min(n_targets, n_most)
        found = search.round(n_targets, bound)
        best = min(best, found, key=lambda one: one.error)
    return best


def fit_given_morphs(moves: Floats, n_targets: int, bound: float) -> Morphs:
    """The targets of a given number with the least error that is found, or one within `bound`."""
    search = _Search(_axes_first(moves))
    best = search.round(min(n_targets, *moves.shape), bound)
    aim = FIRST_AIM * best.error
    for _ in range(GIVEN_ROUNDS):
        if best.error <= bound or len(best.targets) < n_targets:  # fewer are exact
            break
        found = search.round(n_targets, max(bound, aim))
        best = min(best, found, key=lambda one: one.error)
        aim = min(aim, NEXT_AIM * best.error) if best.error <= aim else aim
    return _vertices_first(best)


def measure(targets: IntegerTargets, weights: Floats, moves: Floats) -> Morphs:
    """Targets and weights with their errors."""
    errors = np.empty(len(moves), np.float32)

    def compare(frames: slice) -> None:
        misses = _axes_first(moves[frames] - weights[frames] @ targets.values)
        errors[frames] = _lengths(misses).max(axis=1)

    in_threads(compare, chunks(len(moves), FRAMES_AT_ONCE))
    return Morphs(targets, weights, errors)


class _Search:
    """Where vertices are to go, round by round."""

    def __init__(self, moves: Floats) -> None:
        self._moves = moves
        self._aims = moves.copy()
        self._excess = np.zeros_like(moves)

    def round(self, n_targets: int, bound: float) -> Morphs:
        """Targets for where vertices are to go now; what they are off beyond a bound is noted."""
        _, time_vectors = joint_trajectories(self._aims[None], n_targets)
        reach = np.abs(time_vectors).max(axis=0)
        fields = project(time_vectors.astype(np.float32), self._aims)
        targets = integer_targets(fields, reach, NOISE * bound)
        weights = best_weights(targets, self._aims)
        errors = np.empty(len(self._moves), np.float32)

        def correct(frames: slice) -> None:
            errors[frames] = self._correct(frames, weights[frames] @ targets.values, bound)

        in_threads(correct, chunks(len(self._moves), FRAMES_AT_ONCE))
        return Morphs(targets, weights, errors)

    def _correct(self, frames: slice, made: Floats, bound: float) -> Floats:
        """The largest error of each frame; aims and excess are those of the next round."""
        moves, excess = self._moves[frames], self._excess[frames]
        misses = moves - made
        errors: Floats = _lengths(misses).max(axis=1)
        misses += excess
        distances = np.maximum(_lengths(misses), np.finfo(np.float32).tiny)
        within = _scaled(misses, np.minimum(1, NARROWED * bound / distances))
        misses -= within
        misses = _scaled(
            misses, np.minimum(1, bound / np.maximum(distances - NARROWED * bound, 1e-30))
        )
        excess[:] = misses
        self._aims[frames] = moves - within + excess
        return errors


def _axes_first(moves: Floats) -> Floats:
    """Moves of shape (T, 3 V) whose axes alternate, those of an axis after the other."""
    by_vertices = moves.reshape(len(moves), -1, 3)
    return np.ascontiguousarray(by_vertices.transpose(0, 2, 1)).reshape(moves.shape)


def _vertices_first(found: Morphs) -> Morphs:
    """The opposite, of targets."""
    integers = found.targets.integers
    by_vertices = integers.reshape(len(integers), 3, -1).transpose(0, 2, 1)
    ordered = np.ascontiguousarray(by_vertices).reshape(integers.shape)
    return replace(found, targets=replace(found.targets, integers=ordered))


def _lengths(moves: Floats) -> Floats:
    """Lengths of moves, an axis after the other, of shape (T, V)."""
    x, y, z = (axis for axis in moves.reshape(len(moves), 3, -1).swapaxes(0, 1))
    squares = x * x
    squares += y * y
    squares += z * z
    return np.asarray(np.sqrt(squares, out=squares))


def _scaled(moves: Floats, factors: Floats) -> Floats:
    """Moves, an axis after the other, times factors of shape (T, V)."""
    by_axes = moves.reshape(len(moves), 3, -1)
    return np.asarray(by_axes * factors[:, np.newaxis]).reshape(moves.shape)


def _start(moves: Floats, error: float) -> int:
    """The least number of components of which no vertex is further off than `error`."""
    _, time_vectors = joint_trajectories(moves[None], min(moves.shape))
    weights = time_vectors.astype(np.float32)
    fields = project(weights, moves)
    low, high = 1, weights.shape[1]
    while low < high:
        middle = (low + high) // 2
        if _is_within(moves, weights[:, :middle], fields[:middle], error):
            high = middle
        else:
            low = middle + 1
    return low


def _is_within(moves: Floats, weights: Floats, fields: Floats, error: float) -> bool:
    exceeding: list[slice] = []

    def compare(frames: slice) -> None:
        if not exceeding:
            misses = moves[frames] - weights[frames] @ fields
            if _lengths(misses).max() > error:
                exceeding.append(frames)

    in_threads(compare, chunks(len(moves), FRAMES_AT_ONCE))
    return not exceeding
