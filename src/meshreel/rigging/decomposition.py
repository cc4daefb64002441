"""Skinning decomposition: bones, vertex weights and a rest pose that reproduce an animation.

The alternation of Le and Deng, "Smooth skinning decomposition with rigid bones", SIGGRAPH Asia
2012: rigid transforms of bones by weighted Procrustes, convex weights of at most four bones per
vertex. Added to it are the rest pose, which is fitted too, bones added where the error is largest,
and the excess of errors over a bound, which pulls the fit towards the worst vertices.

All steps need only moments: sums of products over vertices or frames, from matrix products. So a
round costs two matrix products of all frames with the bones.
"""

import math
from copy import copy
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats, Integers, Real
from meshreel.model.rig import MAX_INFLUENCES, scatter
from meshreel.runtime.threads import in_chunks

N_CANDIDATES = 10
"""Candidate bones of a vertex: those nearest in motion, and its former ones."""

N_SWEEPS = 4
"""Sweeps over all bones in each round."""

CHUNK = 2048
"""Vertices whose candidate weights are solved together."""

N_PIECES = 16
"""Pieces of a matrix product, for threads."""

DAMPING = 1e-6
"""Share of the former transform, and of the former rest position, in a new one."""

MAX_PULL = 2.0
"""Largest distance between an aim and the position, in error bounds."""

MONOMIALS = np.triu_indices(4)


@dataclass(frozen=True, eq=False)
class Skin:
    """A skinned animation without quantization."""

    rest: Floats
    """float64 array of shape (V, 3)."""
    bones: Integers
    """int64 array of shape (V, 4). Bones of each vertex."""
    weights: Floats
    """float64 array of shape (V, 4). Not negative, with sum 1."""
    transforms: Floats
    """float64 array of shape (T, B, 3, 4). Rotation and translation of each bone in each frame,
    from the rest pose.
    """

    @property
    def n_bones(self) -> int:
        """Number of bones."""
        return int(self.transforms.shape[1])

    def dense_weights(self) -> Floats:
        """Return the weights of all bones, of shape (V, B)."""
        return scatter(self.weights, self.bones, self.n_bones)

    def frames(self) -> Floats:
        """Return the positions in all frames, as rows x, y, z of each frame: (3 T, V)."""
        matrices = self.transforms.transpose(0, 2, 1, 3).reshape(-1, 4 * self.n_bones)
        return product(matrices, _weighted_rest(self.dense_weights(), self.rest).T)


def product(left: Floats, right: Floats) -> Floats:
    """Return the matrix product, computed in threads."""
    result = np.empty((len(left), right.shape[1]))

    def multiply(rows: slice) -> None:
        np.matmul(left[rows], right, out=result[rows])

    in_chunks(multiply, len(left), math.ceil(len(left) / N_PIECES))
    return result


def _weighted_rest(weights: Floats, rest: Floats) -> Floats:
    """Return w (x, y, z, 1) of each vertex and bone, of shape (V, 4 B)."""
    points = np.column_stack([rest, np.ones(len(rest))])
    return (weights[:, :, np.newaxis] * points[:, np.newaxis]).reshape(len(rest), -1)


def extend(pulls: Real, residuals: Real, bound: float) -> Real:
    """Return vectors from positions to the aims of a fit, longer where residuals exceed a bound.

    Aims beyond the positions pull a fit towards the worst vertices.

    Parameters
    ----------
    pulls, residuals : float arrays
        Their second axis is x, y, z.
    """
    moved: Real = pulls + residuals * np.clip(1 - bound / _lengths(residuals), 0, 1)
    moved *= np.minimum(1, MAX_PULL * bound / _lengths(moved))
    return moved


def _lengths(vectors: Real) -> Real:
    squares: Real = np.einsum("iv...,iv...->i...", vectors, vectors)[:, np.newaxis]
    return np.asarray(np.maximum(np.sqrt(squares), 1e-30))


def fit_rigid(moments: Floats, gram: Floats, former: Floats) -> Floats:
    """Return the rotations and translations that best map weighted points, never reflections.

    Parameters
    ----------
    moments : float64 array of shape (T, 3, 4)
        Sum of w q (p, 1) over points p with weights w and their targets q.
    gram : float64 array of shape (4, 4)
        Sum of w^2 (p, 1) (p, 1).
    former : float64 array of shape (T, 3, 4)
        Former transforms, which determine the rotation as far as the points do not.
    """
    total = gram[3, 3]
    if total <= 0:
        return former
    center, target = gram[3, :3] / total, moments[:, :, 3] / total
    spread = gram[:3, :3] - total * np.outer(center, center)
    covariance = moments[:, :, :3] - total * target[:, :, np.newaxis] * center
    damping = DAMPING * (np.trace(spread) + 1e-12 * total)
    u, _, vt = np.linalg.svd(covariance + damping * former[:, :, :3])
    u[:, :, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))[:, np.newaxis]
    rotation = u @ vt
    return np.concatenate([rotation, (target - rotation @ center)[:, :, np.newaxis]], axis=2)


class Decomposition:
    """A skin that is fitted to an animation, round by round.

    Parameters
    ----------
    frames : float64 array of shape (3 T, V)
        Rows x, y, z of each frame; centered, for accuracy.
    rest : float64 array of shape (V, 3)
        Initial rest pose.
    components : int64 array of shape (V,)
        Connected component of each vertex.
    """

    def __init__(self, frames: Floats, rest: Floats, components: Integers) -> None:
        self._frames, self._components = frames, components
        self._aims = frames
        self._n_frames, n_verts = len(frames) // 3, len(rest)
        self.rest: Floats = rest.copy()
        self.bones: Integers = np.zeros((n_verts, MAX_INFLUENCES), np.int64)
        self.weights: Floats = np.zeros((n_verts, MAX_INFLUENCES))
        self.transforms: Floats = np.empty((self._n_frames, 0, 3, 4))

    @property
    def skin(self) -> Skin:
        """The current skin."""
        return Skin(self.rest, self.bones, self.weights, self.transforms)

    @property
    def n_bones(self) -> int:
        """Number of bones."""
        return int(self.transforms.shape[1])

    def copy(self) -> "Decomposition":
        """Return a copy that changes independently."""
        duplicate = copy(self)
        duplicate.set_skin(self.skin)
        return duplicate

    def set_skin(self, skin: Skin) -> None:
        """Continue from another skin of the same animation."""
        self.rest, self.bones, self.weights = (
            skin.rest.copy(),
            skin.bones.copy(),
            skin.weights.copy(),
        )
        self.transforms = skin.transforms

    def prune(self, error: float) -> None:
        """Remove influences with little effect, and update the transforms.

        Parameters
        ----------
        error : float
            Root mean squared error of a vertex that removing an influence may add.
        """
        self._update_weights(*self._products(), cost=self._n_frames * error**2)
        self._update_transforms()

    def fit_rest(self) -> None:
        """Update the rest pose alone."""
        self._update_rest(*self._products())

    def component_seeds(self, max_bones: int, tolerance: float) -> list[Integers]:
        """Return sets of vertices for the first bones: components that move apart.

        Parameters
        ----------
        tolerance : float
            Root mean squared error of a component that another one's bone moves.
        """
        order = np.argsort(self._components, kind="stable")
        sizes = np.bincount(self._components)
        sets = np.split(order, np.cumsum(sizes)[:-1])
        least_errors = np.array([self._error(verts, self._rigid(verts)) for verts in sets])
        errors = np.full(len(sets), np.inf)
        limits = least_errors + sizes * self._n_frames * tolerance**2
        chosen_sets: list[Integers] = []
        while len(chosen_sets) < max_bones:
            gains = np.where(errors > limits, np.minimum(errors, 1e300) - least_errors, -1.0)
            if chosen_sets and gains.max() <= 0:
                break
            worst = int(np.where(np.isinf(errors), sizes, gains).argmax())
            chosen_sets.append(sets[worst])
            bone = self._rigid(sets[worst])
            errors = np.minimum(errors, [self._error(verts, bone) for verts in sets])
        return chosen_sets

    def _error(self, verts: Integers, bone: Floats) -> float:
        """Return the squared error of vertices that a bone moves."""
        points = np.column_stack([self.rest[verts], np.ones(len(verts))])
        return float(np.square(self._frames[:, verts] - bone.reshape(-1, 4) @ points.T).sum())

    def add_bones(self, sets: list[Integers]) -> None:
        """Add a bone for each set of vertices, which moves them rigidly."""
        bones = [self._rigid(verts) for verts in sets]
        self.transforms = np.concatenate([self.transforms, np.stack(bones, axis=1)], axis=1)

    def _rigid(self, verts: Integers) -> Floats:
        points = np.column_stack([self.rest[verts], np.ones(len(verts))])
        moments = (self._frames[:, verts] @ points).reshape(-1, 3, 4)
        former = np.tile(np.eye(3, 4), (self._n_frames, 1, 1))
        return fit_rigid(moments, points.T @ points, former)

    def round(self, *, fits_rest: bool = True) -> None:
        """Update weights, rest pose and transforms."""
        products = self._products()
        self._update_weights(*products)
        if fits_rest:
            self._update_rest(*products)
        self._update_transforms()

    def _products(self) -> tuple[Floats, Floats]:
        """Return moments over frames: M M^T of shape (B, 4, B, 4), and x M, (V, B, 4)."""
        n_bones = self.transforms.shape[1]
        matrices = self.transforms.transpose(0, 2, 1, 3).reshape(-1, 4 * n_bones)
        return (
            (matrices.T @ matrices).reshape(n_bones, 4, n_bones, 4),
            product(self._aims.T, matrices).reshape(-1, n_bones, 4),
        )

    def _update_weights(self, squares: Floats, projections: Floats, cost: float = 0.0) -> None:
        n_bones = squares.shape[0]
        n_candidates = min(N_CANDIDATES, n_bones)
        symmetric = (squares + squares.transpose(0, 3, 2, 1)) / 2
        grams = symmetric.transpose(0, 2, 1, 3)[:, :, *MONOMIALS]  # (B, B, 10)
        factors = np.where(MONOMIALS[0] == MONOMIALS[1], 1, 2)
        n_former = MAX_INFLUENCES if self.weights.any() else 0

        def choose(part: slice) -> None:
            points = np.column_stack([self.rest[part], np.ones(len(self.rest[part]))])
            monomials = points[:, MONOMIALS[0]] * points[:, MONOMIALS[1]] * factors
            matches = np.einsum("vbi,vi->vb", projections[part], points)
            distances = monomials @ grams[np.arange(n_bones), np.arange(n_bones)].T - 2 * matches
            if n_former:
                rows, cols = np.nonzero(self.weights[part] > 0)
                distances[rows, self.bones[part][rows, cols]] = -np.inf
            candidates = np.argpartition(distances, n_candidates - 1, axis=1)[:, :n_candidates]
            pairs = grams[candidates[:, :, np.newaxis], candidates[:, np.newaxis]]
            gram = np.einsum("vijm,vm->vij", pairs, monomials)
            weights = convex_weights(gram, np.take_along_axis(matches, candidates, axis=1), cost)
            n_influences = min(MAX_INFLUENCES, n_candidates)
            largest = np.argsort(-weights, axis=1)[:, :n_influences]
            self.bones[part], self.weights[part] = 0, 0
            self.bones[part, :n_influences] = np.take_along_axis(candidates, largest, axis=1)
            self.weights[part, :n_influences] = np.take_along_axis(weights, largest, axis=1)

        in_chunks(choose, len(self.rest), CHUNK)

    def _update_rest(self, squares: Floats, projections: Floats) -> None:
        damping = DAMPING * self._n_frames * 3

        def solve(part: slice) -> None:
            bones, weights = self.bones[part], self.weights[part]
            pairs = squares[bones[:, :, np.newaxis], :, bones[:, np.newaxis], :]
            gram = np.einsum("vj,vk,vjkab->vab", weights, weights, pairs, optimize=True)
            selected = np.take_along_axis(projections[part], bones[:, :, np.newaxis], axis=1)
            matches = np.einsum("vj,vja->va", weights, selected)[:, :3] - gram[:, :3, 3]
            matches += damping * self.rest[part]
            self.rest[part] = np.linalg.solve(
                gram[:, :3, :3] + damping * np.eye(3), matches[:, :, np.newaxis]
            )[:, :, 0]

        in_chunks(solve, len(self.rest), CHUNK)

    def _update_transforms(self) -> None:
        n_bones = self.n_bones
        weighted = _weighted_rest(self.skin.dense_weights(), self.rest)
        moments = product(self._aims, weighted).T.reshape(n_bones, 4, -1, 3)
        grams = (weighted.T @ weighted).reshape(n_bones, 4, n_bones, 4)
        matrices = self.transforms.transpose(1, 3, 0, 2).copy()
        is_neighbor = np.abs(grams).max(axis=(1, 3)) > 0
        np.fill_diagonal(is_neighbor, False)
        neighbors = [np.flatnonzero(row) for row in is_neighbor]
        for bone, near in N_SWEEPS * list(enumerate(neighbors)):
            target = moments[bone] - np.tensordot(grams[bone][:, near], matrices[near], 2)
            matrices[bone] = fit_rigid(
                target.transpose(1, 2, 0), grams[bone, :, bone], matrices[bone].transpose(1, 2, 0)
            ).transpose(2, 0, 1)
        self.transforms = matrices.transpose(2, 0, 3, 1)

    def residuals(self) -> Floats:
        """Return the animation minus the skin, of shape (3 T, V)."""
        skinned = self.skin.frames()
        return np.subtract(self._frames, skinned, out=skinned)

    def aim(self, residuals: Floats, bound: float) -> None:
        """Move the aims of the fit beyond positions with an error above a bound.

        Aims move farther in each call, up to a limit.
        """
        shape = self._n_frames, 3, -1
        frames, aims = self._frames.reshape(shape), self._aims.reshape(shape)
        moved, errors = np.empty_like(frames), residuals.reshape(shape)

        def move(part: slice) -> None:
            moved[part] = frames[part] + extend(aims[part] - frames[part], errors[part], bound)

        in_chunks(move, self._n_frames, math.ceil(self._n_frames / N_PIECES))
        self._aims = moved.reshape(residuals.shape)

    def seeds(self, residuals: Floats, n_new: int) -> list[Integers]:
        """Return sets of vertices for new bones, where the error is largest."""
        errors = np.square(residuals).sum(axis=0)
        radius = (
            0.5 * float(np.ptp(self.rest, axis=0).max()) / max(1, self.transforms.shape[1]) ** 0.5
        )
        seeds = []
        for _ in range(n_new):
            worst = int(errors.argmax())
            if errors[worst] <= 0:
                break
            distances = np.linalg.norm(self.rest - self.rest[worst], axis=1)
            distances[self._components != self._components[worst]] = np.inf
            n_near = min(len(errors), 24)
            near = np.argpartition(distances, n_near - 1)[:n_near]
            seeds.append(near[np.isfinite(distances[near])])
            errors *= 1 - np.exp(-np.square(distances / radius))
        return seeds


def convex_weights(gram: Floats, matches: Floats, cost: float = 0.0) -> Floats:
    """Return nonnegative weights of at most four candidates per vertex, with sum 1.

    Minimize w A w - 2 w b by backward elimination: of the weights that solve the equations, the
    most negative is removed, or else the one whose removal costs least, until four remain.

    Parameters
    ----------
    gram : float64 array of shape (N, C, C)
    matches : float64 array of shape (N, C)
    cost : float, default 0
        Increase of the squared error up to which further candidates are removed.
    """
    n_verts, n_candidates = matches.shape
    weights = np.zeros((n_verts, n_candidates))
    active = np.ones((n_verts, n_candidates), bool)
    pending = np.arange(n_verts)
    eye = np.eye(n_candidates)
    scale = np.einsum("vii->v", gram)[:, np.newaxis, np.newaxis] / n_candidates + 1e-300
    gram = gram / scale + 1e-9 * eye
    matches = matches / scale[:, 0]
    while len(pending):
        mask = active[pending]
        both = mask[:, :, np.newaxis] & mask[:, np.newaxis]
        inverse = np.linalg.inv(np.where(both, gram[pending], eye))
        inverse = np.where(both, inverse, 0)
        sums = inverse.sum(axis=2)
        total = sums.sum(axis=1, keepdims=True)
        unconstrained = np.einsum("vij,vj->vi", inverse, matches[pending])
        solution = unconstrained + sums * (1 - unconstrained.sum(axis=1, keepdims=True)) / total
        variances = np.einsum("vii->vi", inverse) - np.square(sums) / total
        costs = np.where(mask, np.square(solution) / np.maximum(variances, 1e-300), np.inf)
        lowest = np.where(mask, solution, np.inf)
        is_negative = lowest.min(axis=1) < 0
        n_active = mask.sum(axis=1)
        removed = np.where(is_negative, lowest.argmin(axis=1), costs.argmin(axis=1))
        is_costly = costs.min(axis=1) * scale[pending, 0, 0] > cost
        is_done = ~is_negative & (n_active <= MAX_INFLUENCES) & is_costly | (n_active == 1)
        done = pending[is_done]
        weights[done] = np.where(mask, solution, 0)[is_done]
        pending, removed = pending[~is_done], removed[~is_done]
        active[pending, removed] = False
    return weights
