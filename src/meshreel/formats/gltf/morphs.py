"""Fitting few morph targets and their weights to an animation, within a bound on every vertex.

Positions are fitted first; then some of their targets also get normals.

Principal components minimize the mean error, not the maximum: a few vertices in a few frames have
large errors, and nearly twice as many components as needed would be required to reduce them.
Therefore the error of these vertices beyond the bound is added to their target positions, and the
components are computed again, some dozens of times. This is the alternating direction method of
multipliers (Boyd et al. 2011, section 9.1) for matrices of rank K within a distance of the frames.
The multipliers are bounded, since K grows meanwhile, and while it is too small, no such matrix
exists. Targets are rounded to integers in every round, so that rounding errors are compensated.

Frames are displacements from the base mesh, of shape (T, 3 V), in the units of the mesh.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles
from meshreel.codec.subspace.pca import FIRST_COUNT, N_ITERATIONS, OVERSAMPLING
from meshreel.errors import InvalidInputError
from meshreel.formats.gltf.container import IDENTITY, Placement
from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.geometry.normals import face_normals, vertex_normals
from meshreel.model.sequence import Faces, Vertices
from meshreel.runtime.progress import Progress, silent
from meshreel.runtime.threads import chunks, in_threads

BYTE, SHORT = 127, 32767
"""Integers that represent 1 in normalized accessors of int8 and int16."""

FLOAT_STEPS = np.float32(1 << 15)
"""Steps from 0 to 1 of rounded floats: a power of two, so that the mantissas of their multiples end
with zeros, which gzip compresses."""

WEIGHT_STEP_SHARE = 1 / 64
"""Rounding step of weights, as a fraction of the error."""

PIECE_TARGETS, PIECE_VALUES = 16, 8192

MIN_PIVOT = 1e-5
"""Smallest reliable pivot of a Cholesky factor, relative to the largest; a Gram matrix of float32
has no more precision."""


@dataclass(frozen=True, eq=False)
class IntegerTargets:
    """Morph targets, each scaled to coordinates from -1 to 1."""

    integers: npt.NDArray[np.int16]
    """int16 array of shape (K, N). Coordinates of each target: x of all vertices, then y and z,
    which makes NumPy three times as fast as vertex by vertex.
    """
    levels: Singles
    """float32 array of shape (K,). The integer that represents 1 in each target: `BYTE` or `SHORT`
    in normalized accessors, `FLOAT_STEPS` for floats.
    """

    def __len__(self) -> int:
        return len(self.levels)

    @property
    def are_floats(self) -> bool:
        """Whether files store floats."""
        return bool((self.levels == FLOAT_STEPS).any())

    def stored(self, number: int) -> npt.NDArray[Any]:
        """Return a target as files store it: int8, int16 or float32 array of shape (3, V)."""
        if self.are_floats:
            return np.asarray(self.values[number]).reshape(3, -1)
        dtype = np.int8 if self.levels[number] == BYTE else np.int16
        return np.asarray(self.integers[number], dtype).reshape(3, -1)

    @cached_property
    def values(self) -> Singles:
        """The represented values, of shape (K, N)."""
        return np.asarray(self.integers / self.levels[:, None], np.float32)


def integer_targets(
    fields: Singles, max_weights: npt.NDArray[np.float64], noise: float, *, are_floats: bool = True
) -> IntegerTargets:
    """Return quantized targets, with one step for all, which compresses best.

    Parameters
    ----------
    fields : float32 array of shape (K, N)
        Scaled in place.
    max_weights : float array of shape (K,)
        Largest absolute weight of each field.
    noise : float
        Acceptable root mean square of all rounding errors together, in the units of the fields.
    are_floats : bool
        Whether they are stored as floats, or as normalized int8 or int16.
    """
    largest = np.abs(fields).max(axis=1)
    largest[largest == 0] = 1
    maxima = equal_step_maxima(max_weights * largest, noise)
    integers = np.empty(fields.shape, np.int16)

    def quantize(rows: slice) -> None:
        fields[rows] *= (maxima / largest)[rows, None]
        integers[rows] = np.rint(fields[rows])

    in_threads(quantize, chunks(len(fields), PIECE_TARGETS))
    levels = FLOAT_STEPS if are_floats else np.where(maxima <= BYTE, BYTE, SHORT)
    return IntegerTargets(integers, np.broadcast_to(levels, maxima.shape).astype(np.float32))


def equal_step_maxima(amplitudes: npt.NDArray[np.float64], noise: float) -> Singles:
    """Return the largest integer of each target, with one step for all.

    The standard deviation of the rounding error of a coordinate is the step divided by the square
    root of 12.
    """
    step = max(noise / np.sqrt(3 * len(amplitudes) / 12), amplitudes.max() / SHORT)
    return np.asarray(np.ceil(amplitudes / step).clip(1, SHORT), np.float32)


def best_weights(targets: IntegerTargets, frames: Singles) -> Singles:
    """Return the weights of all targets in every frame by least squares, of shape (T, K).

    Parameters
    ----------
    frames : float32 array of shape (T, N)
        The displacements to approximate.
    """
    gram = row_products(targets.values, targets.values)
    products = row_products(targets.values, frames)
    return np.ascontiguousarray(solve_gram(gram, products).T, dtype=np.float32)


def row_products(first: Singles, second: Singles) -> Floats:
    """Return the dot products of the rows of two matrices, ``A B^T`` in float64."""
    products = np.empty((len(first), len(second)))

    def multiply(rows: slice) -> None:
        products[rows] = first[rows] @ second.T

    in_threads(multiply, chunks(len(first), PIECE_TARGETS))
    return products


def solve_gram(gram: Floats, products: Floats) -> Floats:
    """Solve ``gram X = products``; the minimum-norm solution if the rows are linearly dependent.

    Parameters
    ----------
    gram : float64 array of shape (K, K)
        ``A A^T`` of the rows to combine.
    products : float64 array of shape (K, n)
        ``A B^T`` with the n rows of B to approximate.

    Returns
    -------
    float64 array of shape (K, n)
    """
    if not gram.size or not products.size:
        return np.zeros(products.shape)
    if _is_regular(gram):
        return np.asarray(np.linalg.solve(gram, products))
    return np.asarray(np.linalg.lstsq(gram, products, rcond=None)[0])


def _is_regular(gram: Floats) -> bool:
    """Whether the smallest pivot of the Cholesky factor is reliable."""
    try:
        pivots = np.diagonal(np.linalg.cholesky(gram))
    except np.linalg.LinAlgError:
        return False
    return bool(pivots.min() > MIN_PIVOT * pivots.max())


def rounded_weights(weights: Singles, error: float) -> Singles:
    """Return weights rounded to a power of two that adds little to an error.

    Their mantissas then have few bits, which compresses well.
    """
    if error <= 0:
        return weights
    step = np.float32(2.0 ** np.floor(np.log2(WEIGHT_STEP_SHARE * error)))
    return np.asarray(np.rint(weights / step) * step, np.float32)


def project(time_vectors: Singles, frames: Singles) -> Singles:
    """Return ``time_vectors^T frames``, the field of each mode, of shape (K, N).

    Parameters
    ----------
    time_vectors : float32 array of shape (T, K)
    frames : float32 array of shape (T, N)
    """
    fields = np.empty((time_vectors.shape[1], frames.shape[1]), np.float32)

    def multiply(columns: slice) -> None:
        fields[:, columns] = time_vectors.T @ frames[:, columns]

    in_threads(multiply, chunks(frames.shape[1], PIECE_VALUES))
    return fields


def max_displacements(frames: Vertices, base: Floats) -> Floats:
    """Return the largest distance of a vertex from the base, in each frame."""
    return np.array([np.linalg.norm(frame - base, axis=1).max() for frame in frames])


def place_static(base: Vertices) -> tuple[Placement, npt.NDArray[np.float32]]:
    """Return a static mesh in float32, relative to its center unless it is exact in float32."""
    rest = base.astype(np.float32)
    if (rest == base).all():
        return IDENTITY, rest
    offset = _center(base)
    return Placement(offset, 1.0), (base - offset).astype(np.float32)


def place_frames(
    frames: Vertices, base: Floats, *, are_floats: bool = True
) -> tuple[Placement, npt.NDArray[Any], Singles]:
    """Return frames relative to a base, with all coordinates within -1 to 1.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    base : float64 array of shape (V, 3)
    are_floats : bool
        Whether the placed base has floats, or normalized int16.

    Returns
    -------
    placement : Placement
    placed : int16 or float32 array of shape (V, 3)
        The base.
    displacements : float32 array of shape (T, 3 V)
        From the placed base, in units of the placement: x of all vertices, then y and z.
    """
    offset = _center(base)
    max_distance = float(max_displacements(frames, base).max())
    reach = max(float(np.abs(base - offset).max()), max_distance)
    smallest = float(np.finfo(np.float32).tiny)
    scale = float(np.nextafter(np.float32(max(reach, smallest)), np.float32(np.inf)))
    steps = float(FLOAT_STEPS) if are_floats else SHORT
    integers = np.rint((base - offset) / scale * steps)
    displacements = np.empty((len(frames), base.size), np.float32)
    rounded = integers / steps
    for row, frame in zip(displacements, frames, strict=True):
        row[:] = ((frame - offset) / scale - rounded).T.ravel()
    placed = rounded.astype(np.float32) if are_floats else integers.astype(np.int16)
    return Placement(offset, scale), placed, displacements


def _center(base: Vertices) -> Floats:
    center = (base.min(axis=0) + base.max(axis=0)) / 2
    return np.asarray(center.astype(np.float32), np.float64)


def check_range(low: Floats, high: Floats) -> None:
    """Raise InvalidInputError unless positions fit into float32, the only float type of glTF."""
    largest = float(np.maximum(-low, high).max())
    allowed = float(np.finfo(np.float32).max) / 4
    if largest > allowed:
        raise InvalidInputError(
            f"glTF stores float32 positions, up to {allowed:.2g}; got {largest:g}; scale the model"
        )


INITIAL_ERROR = 8.0
"""Error of the initial components, as a multiple of the bound."""

GROWTH_DIVISOR = 100
"""Each round grows K, and later tries a smaller K, by this fraction of it, at least by one.

After growth a smaller K often suffices, since K grows faster than the positions converge."""

PATIENCE = 8
"""Failed rounds before the search for a smaller number of targets stops."""

POSITION_SHARE = 0.9
"""Fraction of the bound to which residuals are limited."""

ROUNDING_SHARE = 0.11
"""Mean rounding error of targets, as a fraction of the bound; nearly all are below half."""

NEAR, MAX_NEAR, FINER, MIN_ROUNDING_SHARE = 1.25, 16, 0.9, 0.02
"""An error of less than `NEAR` bounds may be due to rounding. After `MAX_NEAR` such rounds, each
further one multiplies the rounding error by `FINER`, down to the minimum share of the bound."""

MAX_ROUNDS = 60
"""Rounds of slow growth far from the bound; then the number of targets doubles."""

SHARE_LEFT = 0.97
"""Share of the remaining progress after each round; most searches take 20 to 80 rounds."""
PIECE_FRAMES, DECODED_VALUES = 4, 1 << 21
"""Frames that are compared at a time, and values that one matrix product decodes for them."""


@dataclass(frozen=True, eq=False)
class Morphs:
    """Morph targets, weights and errors."""

    targets: IntegerTargets
    weights: Singles
    """float32 array of shape (T, K)."""
    errors: Singles
    """float32 array of shape (T,). Largest error of a vertex in each frame."""

    @property
    def error(self) -> float:
        """Largest error of a vertex in all frames."""
        return float(self.errors.max())


def fit_morphs(
    displacements: Singles,
    bound: float,
    *,
    are_floats: bool = True,
    progress: Progress = silent,
) -> Morphs:
    """Return few targets with which no vertex has an error above `bound`.

    If 16 bits are too coarse for the bound, return those with the smallest error found.
    """
    search = _Search(displacements, are_floats=are_floats, progress=progress)
    n_initial = search.start(INITIAL_ERROR * bound)
    best, n_few = _grow(search, n_initial, min(displacements.shape), bound)
    n_failed = 0
    while best.error <= bound and n_failed < PATIENCE and len(best.targets) > 1:
        n_best = len(best.targets)
        step = max(1, n_best // GROWTH_DIVISOR, (n_best - n_few) // 2)
        morphs = search.round(n_best - step, bound)
        if morphs.error <= bound:
            best, n_failed = morphs, 0
        elif (n_failed := n_failed + 1) == PATIENCE and step > 1:
            n_few, n_failed = n_best - step, 0
    return best


def _grow(search: "_Search", n_targets: int, max_targets: int, bound: float) -> tuple[Morphs, int]:
    """Return targets that meet the bound, and a number that presumably is too small.

    Their number grows in each round. Near the bound, rounding errors of targets can prevent
    progress; then their step decreases.
    """
    best, n_near, n_few = search.round(n_targets, bound), 0, n_targets
    for number in count(1):
        if best.error <= bound or n_targets == max_targets:
            break
        is_near = best.error <= NEAR * bound and search.rounding_share > MIN_ROUNDING_SHARE
        n_few = n_few if is_near else n_targets
        is_slow = number < MAX_ROUNDS or is_near
        growth = max(1, n_targets // GROWTH_DIVISOR) if is_slow else n_targets
        n_targets = min(n_targets + growth, max_targets)
        morphs = search.round(n_targets, bound)
        n_near += is_near
        if n_near > MAX_NEAR:
            search.rounding_share *= FINER
        best = min(best, morphs, key=lambda candidate: candidate.error)
    return best, n_few


def measure(targets: IntegerTargets, weights: Singles, displacements: Singles) -> Morphs:
    """Return targets and weights with their errors."""
    return Morphs(targets, weights, _frame_errors(displacements, weights, targets.values))


def _frame_errors(displacements: Singles, weights: Singles, fields: Singles) -> Singles:
    """Return the largest error of a vertex in each frame."""
    errors = np.empty(len(displacements), np.float32)

    def compare(frames: slice, decoded: Singles) -> None:
        errors[frames] = _lengths(displacements[frames] - decoded).max(axis=1)

    _decode(weights, fields, compare)
    return errors


def _decode(weights: Singles, fields: Singles, use: Callable[[slice, Singles], None]) -> None:
    """Call `use` with the numbers and displacements of a few frames at a time, in any thread."""

    def decode(frames: slice) -> None:
        decoded = weights[frames] @ fields
        for few in chunks(len(decoded), PIECE_FRAMES):
            use(slice(frames.start + few.start, frames.start + few.stop), decoded[few])

    in_threads(decode, chunks(len(weights), max(PIECE_FRAMES, DECODED_VALUES // fields.shape[1])))


class _Search:
    """Target displacements, updated round by round.

    The leading time vectors of the displacements follow by subspace iteration: each round projects
    them once more, and starts from the weights of the last one. So its time is proportional to
    the number of frames.
    """

    def __init__(self, displacements: Singles, *, are_floats: bool, progress: Progress) -> None:
        self._displacements, self._are_floats = displacements, are_floats
        self.rounding_share = ROUNDING_SHARE
        self._progress, self._n_rounds = progress, 0
        self._adjusted = displacements.copy()
        self._excess = np.zeros_like(displacements)
        self._random = np.random.default_rng(0)
        self._vectors = np.empty((len(displacements), 0), np.float32)

    def start(self, error: float) -> int:
        """Return about the smallest number of components with which no error exceeds `error`."""
        high, is_enough = 0, False
        n_most = min(self._displacements.shape)
        while not is_enough and high < n_most:
            high = min(max(2 * high, FIRST_COUNT), n_most)
            for _ in range(N_ITERATIONS):
                _, fields = self._components(high)
                self._vectors = _orthonormal(row_products(self._displacements, fields))
            vectors, fields = self._components(high)
            is_enough = _frame_errors(self._displacements, vectors, fields).max() <= error
        low = 1
        while low < high:
            middle = (low + high) // 2
            few = vectors[:, :middle], fields[:middle]
            is_few = _frame_errors(self._displacements, *few).max() <= error
            low, high = (low, middle) if is_few else (middle + 1, high)
        return low

    def _components(self, n_targets: int) -> tuple[Singles, Singles]:
        """Return time vectors of shape (T, K) and their fields, shape (K, N), by energy.

        There are more than requested; the last ones are less accurate.
        """
        n_more = min(n_targets + OVERSAMPLING, *self._adjusted.shape) - self._vectors.shape[1]
        if n_more > 0:
            more = self._random.standard_normal((len(self._vectors), n_more))
            self._vectors = _orthonormal(np.concatenate([self._vectors, more], axis=1))
        fields = project(self._vectors, self._adjusted)
        _, rotation = np.linalg.eigh(row_products(fields, fields))
        rotation = rotation[:, ::-1].astype(np.float32)
        return self._vectors @ rotation, project(rotation, fields)

    def round(self, n_targets: int, bound: float) -> Morphs:
        """Return morph targets for the adjusted displacements, to which excess errors are added."""
        self._progress("morph targets", 1 - SHARE_LEFT**self._n_rounds)
        self._n_rounds += 1
        vectors, fields = self._components(n_targets)
        max_weights = np.abs(vectors[:, :n_targets]).max(axis=0)
        targets = integer_targets(
            fields[:n_targets],
            max_weights,
            self.rounding_share * bound,
            are_floats=self._are_floats,
        )
        exact = best_weights(targets, self._adjusted)
        more = row_products(self._adjusted, fields[n_targets:])
        self._vectors = _orthonormal(np.concatenate([exact, more], axis=1))
        weights = rounded_weights(exact, bound)
        errors = np.empty(len(self._displacements), np.float32)

        def update(frames: slice, decoded: Singles) -> None:
            errors[frames] = self._update(frames, decoded, bound)

        _decode(weights, targets.values, update)
        return Morphs(targets, weights, errors)

    def _update(self, frames: slice, decoded: Singles, bound: float) -> Singles:
        """Update adjustment and excess of some frames, and return the largest error of each."""
        displacements, excess = self._displacements[frames], self._excess[frames]
        residuals = displacements - decoded
        errors: Singles = _lengths(residuals).max(axis=1)
        residuals += excess
        distances = np.maximum(_lengths(residuals), np.finfo(np.float32).tiny)
        limited = _scale(residuals, np.minimum(1, POSITION_SHARE * bound / distances))
        residuals -= limited
        excess_lengths = np.maximum(distances - POSITION_SHARE * bound, 1e-30)
        residuals = _scale(residuals, np.minimum(1, bound / excess_lengths))
        excess[:] = residuals
        self._adjusted[frames] = displacements - limited + excess
        return errors


def _lengths(displacements: Singles) -> Singles:
    """Return the lengths of displacements, of shape (T, V)."""
    by_axes = displacements.reshape(len(displacements), 3, -1)
    x, y, z = (axis for axis in by_axes.swapaxes(0, 1))
    squares = x * x
    squares += y * y
    squares += z * z
    return np.asarray(np.sqrt(squares, out=squares))


def _scale(displacements: Singles, factors: Singles) -> Singles:
    """Return displacements times factors of shape (T, V)."""
    by_axes = displacements.reshape(len(displacements), 3, -1)
    return np.asarray(by_axes * factors[:, np.newaxis]).reshape(displacements.shape)


def _orthonormal(vectors: npt.NDArray[np.floating]) -> Singles:
    """Return an orthonormal basis of the columns of a matrix."""
    return np.asarray(np.linalg.qr(vectors)[0], np.float32)


MAX_CREASED_SHARE = 0.25
"""Share of creases above which a surface presumably is faceted."""

CREASE_DEG = 60.0
"""Smallest dihedral turn between two faces whose edge is a crease."""


NORMAL_STEP = 1 / 32
"""Rounding step of the floats by which a target displaces unit normals, at its largest weight."""


@dataclass(frozen=True, eq=False)
class NormalTargets:
    """Normals of the base mesh, and displacements of normals by morph targets."""

    base: npt.NDArray[Any]
    """int8 or float32 array of shape (V, 3)."""
    targets: npt.NDArray[Any] = field(default_factory=lambda: np.empty(0, np.float32))
    """int8 or float32 array of shape (N, V, 3)."""
    numbers: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    """int64 array of shape (N,). Indices of the morph targets with normals; default: none."""
    angle_deg: float = 0.0
    """Mean angle between animated and original normals."""


def wants_normals(normals: bool | None, frame: Vertices, faces: Faces) -> bool:
    """Return whether a mesh gets normals, by default if it is smooth in one frame."""
    return creased_share(frame, faces) <= MAX_CREASED_SHARE if normals is None else normals


def static_normals(vertices: Vertices, faces: Faces) -> NormalTargets:
    """Return the normals of a static mesh, without targets."""
    return NormalTargets(_units(vertex_normals(vertices, faces)).astype(np.float32))


def fit_normals(
    frames: Vertices,
    faces: Faces,
    displacements: npt.NDArray[np.float32],
    morphs: Morphs,
    length_error: float = 0.0,
) -> tuple[Morphs, NormalTargets]:
    """Return morphs of positions and normals, with one additional target, and the normals.

    A weight that moves vertices a little may rotate normals a lot, but a target can add at most 1
    to a normal. So where that is too little, targets are scaled down and weights up. The targets
    with the largest weights get normals, as many as needed.

    Normals of the base mesh must have length 1. But the displacements are relative to the mean
    normal, which is shorter where a vertex rotates: the additional target, which moves no vertex
    and has a constant weight, compensates for that.

    Parameters
    ----------
    frames : float array of shape (T, R, 3)
        Positions of vertices with one normal each, split at hard edges.
    faces : int32 array of shape (M, 3)
        Faces as indices into these vertices.
    displacements : float32 array of shape (T, 3 V)
        The displacements to which `morphs` was fitted, to measure its errors again.
    length_error : float, default 0
        Acceptable root mean square error of unit normals; 0 to use all targets.
    """
    normals = np.stack([vertex_normals(frame, faces).astype(np.float32) for frame in frames])
    base = _units(normals.mean(axis=0, dtype=np.float64))
    offsets = (normals - base.astype(np.float32)).reshape(len(frames), -1)
    selected = select_normal_targets(morphs.weights, offsets, length_error)
    numbers = np.append(selected, len(morphs.targets))
    weights = np.column_stack([morphs.weights, np.ones(len(frames), np.float32)])
    inverse = np.linalg.pinv(weights[:, numbers].astype(np.float64))
    fields = project(inverse.T.astype(np.float32), offsets)
    factors = np.maximum(1, np.abs(fields).max(axis=1))
    weights[:, numbers] *= factors
    are_floats, scaled_fields = morphs.targets.are_floats, fields / factors[:, None]
    rounded = (
        _round_floats(scaled_fields, weights[:, numbers])
        if are_floats
        else _as_bytes(scaled_fields)
    )
    weights = rounded_weights(weights, morphs.error)
    scaled_targets = _scale_down(morphs.targets, selected, factors[:-1])
    scaled_morphs = measure(scaled_targets, weights, displacements)
    stored_base = base.astype(np.float32) if are_floats else _as_bytes(base)
    normal_targets = NormalTargets(stored_base, rounded.reshape(len(factors), -1, 3), numbers)
    return scaled_morphs, replace(
        normal_targets, angle_deg=_mean_angle_deg(normal_targets, weights, normals)
    )


def select_normal_targets(
    weights: npt.NDArray[np.float32], offsets: npt.NDArray[np.float32], length_error: float
) -> npt.NDArray[np.int64]:
    """Return the fewest targets, by decreasing weights, that reach the mean error of normals."""
    order = np.argsort(-np.square(weights, dtype=np.float64).sum(axis=0), kind="stable")
    constant = np.ones((len(weights), 1))
    basis = _orthonormal(np.column_stack([constant, weights[:, order].astype(np.float64)]))
    explained_energy = np.cumsum(_energies(project(basis, offsets)))
    allowed = length_error**2 * offsets.size / 3
    n_needed = int(np.count_nonzero(_energies(offsets).sum() - explained_energy[:-1] > allowed))
    return np.sort(order[:n_needed] if length_error else order)


def _energies(rows: Singles) -> Floats:
    """Return the sum of the squares of each row."""
    return np.asarray(np.einsum("kn,kn->k", rows, rows, dtype=np.float64))


def _scale_down(
    targets: IntegerTargets, numbers: npt.NDArray[np.int64], factors: npt.NDArray[np.floating]
) -> IntegerTargets:
    """Return targets, some of them scaled down, and an additional one that moves no vertex."""
    finest, coarsest = (FLOAT_STEPS, FLOAT_STEPS) if targets.are_floats else (SHORT, BYTE)
    levels = np.append(targets.levels, np.float32(coarsest))
    integers = np.concatenate([targets.integers, np.zeros_like(targets.integers[:1])])
    scaled_numbers = numbers[factors > 1]
    values = targets.values[scaled_numbers] * (finest / factors[factors > 1])[:, None]
    integers[scaled_numbers], levels[scaled_numbers] = np.rint(values), finest
    return IntegerTargets(integers, levels)


def _mean_angle_deg(
    normal_targets: NormalTargets,
    weights: npt.NDArray[np.float32],
    normals: npt.NDArray[np.float32],
) -> float:
    """Return the mean angle between normals as they are stored and the original ones."""
    base = _as_floats(normal_targets.base)
    displacements = _as_floats(normal_targets.targets).reshape(len(normal_targets.targets), -1)
    angles = []
    for frame_weights, expected in zip(weights[:, normal_targets.numbers], normals, strict=True):
        decoded = base + (frame_weights @ displacements).reshape(expected.shape)
        lengths = np.linalg.norm(decoded, axis=1) * np.linalg.norm(expected, axis=1)
        cosines = np.einsum("ij,ij->i", decoded, expected) / np.where(lengths > 0, lengths, 1)
        angles.append(np.arccos(np.clip(cosines[lengths > 0], -1, 1)))
    all_angles = np.concatenate(angles)
    return float(np.degrees(all_angles.mean())) if len(all_angles) else 0.0


def _units(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return vectors scaled to length 1, or the z axis for zero vectors."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), np.array([0.0, 0.0, 1.0]))


def _as_bytes(values: npt.NDArray[np.floating]) -> npt.NDArray[np.int8]:
    return np.asarray(np.rint(values * BYTE), np.int8)


def _as_floats(stored: npt.NDArray[Any]) -> Singles:
    """Return the values that floats, or bytes of normalized accessors, represent."""
    return np.asarray(stored / np.float32(BYTE if stored.dtype == np.int8 else 1), np.float32)


def _round_floats(fields: Singles, weights: Singles) -> Singles:
    """Return fields of normals rounded to multiples of powers of two, so that mantissas are short.

    Parameters
    ----------
    fields : float32 array of shape (K, N)
    weights : float32 array of shape (T, K)
    """
    exponents = np.floor(np.log2(NORMAL_STEP / np.abs(weights).max(axis=0).clip(1e-6, 1e6)))
    steps = np.exp2(exponents).astype(np.float32)[:, np.newaxis]
    return np.asarray(np.rint(fields / steps) * steps, np.float32)


def creased_share(vertices: npt.NDArray[np.floating], faces: Faces) -> float:
    """Length of creases as a share of that of all edges between two faces; 1 without such edges.

    Boundary edges, edges of more than two faces and faces without area do not count.

    Parameters
    ----------
    vertices : float array of shape (V, 3)
    faces : integer array of shape (M, 3)
    """
    normals = face_normals(vertices, faces)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    units = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    shared = shared_edges(np.full(len(faces), 3), faces.ravel())
    sides = np.argsort(shared.of_side, kind="stable")
    sides = sides[shared.of_side[sides] >= 0]
    is_pair = np.bincount(shared.of_side[sides]) == 2
    ends, pairs = shared.ends[is_pair], sides[is_pair[shared.of_side[sides]]].reshape(-1, 2) // 3
    has_area = (lengths[pairs, 0] > 0).all(axis=1)
    ends, pairs = ends[has_area], pairs[has_area]
    sides = np.linalg.norm(np.diff(vertices[ends].astype(np.float64), axis=1)[:, 0], axis=1)
    cosines = np.einsum("ij,ij->i", units[pairs[:, 0]], units[pairs[:, 1]])
    is_crease = cosines < np.cos(np.radians(CREASE_DEG))
    return float(sides[is_crease].sum() / sides.sum()) if sides.sum() > 0 else 1.0
