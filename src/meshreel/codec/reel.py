"""The method `reel`: mode fields, predicted over the mesh by weights learned from earlier ones.

A mode is one field on the mesh with a time vector for each axis. Fields are coded in groups, and
each group over the levels of a hierarchy of the vertices, in closed loop. What foretells a vertex
from its stencil is learned from the groups decoded before; what foretells the first group, from
connectivity. A decoded group is smoothed by filters whose taps are sent.

Encoder and decoder run the same `reconstruct_fields` and `reconstruct_times`; they differ only in
where the integers come from.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.codec.closed_loop import Predictor, StepsOf, reconstruct_levels
from meshreel.codec.mesh_model import MeshModel
from meshreel.codec.timeline import time_predictors
from meshreel.entropy.passes import Pass
from meshreel.geometry.connectivity import adjacency_matrix
from meshreel.geometry.hierarchy import Scale, build_hierarchy
from meshreel.geometry.laplacian import reproducing_laplacian
from meshreel.geometry.prediction import (
    Stencils,
    WeightLearner,
    joined_stencils,
    smooth_stencils,
)
from meshreel.quantization.rate_distortion import FAIR_PRICE, quantize_by_rate
from meshreel.subspace.pca import joint_trajectories

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

NOISE_OF_WEIGHTS = 1.0 / 12.0
NOISE_OF_FILTERS = 8.0 / 12.0
"""Ridges of learned weights in squared steps; rounding has a variance of 1/12."""

N_FILTER_FIELDS = 6
"""Fields, the first ones, that the weights of filters are learned from: more change little."""

N_TAPS = 2
TAP_STEP = 1.0 / 16.0
MAX_TAP = 127
SMALL_SCALE = 25
"""Scales with fewer than a 25th of the vertices are coded in one pass."""

N_TELLING = 6
"""Vertices of a stencil, the nearest ones, that tell how large an integer is likely to be."""


@dataclass(frozen=True)
class Layout:
    """What the decoder has to know of how a block was made.

    Attributes
    ----------
    step : float32
        Of the fields.
    group_ends : tuple of int
        Number of the mode behind each group; ascending, the last is K.
    stencil_size : int
        Vertices that foretell one.
    """

    step: np.float32
    group_ends: tuple[int, ...]
    stencil_size: int

    @property
    def groups(self) -> list[slice]:
        """The modes of each group."""
        return [slice(start, end) for start, end in pairwise((0, *self.group_ends))]


@dataclass(frozen=True)
class FieldChoices:
    """What the encoder chooses.

    Attributes
    ----------
    position_step : float
        Step as it acts on a position, in diagonals; coefficients of T frames have sqrt(T) times
        this step.
    n_modes : int or None
        At most this many; None for all that the step does not make vanish.
    basis_step : float
        Step of the time vectors by that of the fields, both as they act on positions.
    least_rms : float
        A mode is kept if its field's root mean square exceeds this share of a step.
    price : float
        Squared steps that a bit is worth.
    carried_share : float
        Share of the error of a prediction that the predicted value takes on instead of undoing
        it. Errors then vary smoothly over the mesh, and fewer steps are sent.
    n_carrying_scales : int
        Scales, the finest ones, where errors are carried: from coarser ones they would spread far.
    has_filters : bool
        Smooth decoded fields.
    group_ends, stencil_size
        As in `Layout`; the last group takes what is left.
    """

    position_step: float
    n_modes: int | None = None
    basis_step: float = 3.0
    least_rms: float = 0.6
    price: float = FAIR_PRICE
    carried_share: float = 0.6
    n_carrying_scales: int = 2
    has_filters: bool = True
    group_ends: tuple[int, ...] = (1, 2, 3, 4, 6, 10)
    stencil_size: int = 10


@dataclass(frozen=True)
class FieldBlock:
    """A block of frames as integers.

    Attributes
    ----------
    layout : Layout
    times : int64 array of shape (T, 3 K)
        Steps of the time vectors; x, y and z of mode 1, of mode 2, ...
    fields : int64 array of shape (K, V)
        Steps of the fields.
    taps : int64 array of shape (K, N_TAPS)
        Of the filter of each field, in TAP_STEP.
    """

    layout: Layout
    times: Integers
    fields: Integers
    taps: Integers

    @property
    def n_modes(self) -> int:
        """K."""
        return int(self.fields.shape[0])

    def first_modes(self, n_modes: int) -> "FieldBlock":
        """The block with at most this many modes: a coarser animation."""
        kept = min(n_modes, self.n_modes)
        layout = replace(self.layout, group_ends=group_ends(kept, self.layout.group_ends))
        return FieldBlock(layout, self.times[:, : 3 * kept], self.fields[:kept], self.taps[:kept])


@dataclass(frozen=True)
class FieldMesh:
    """What both sides derive from connectivity, whatever the step."""

    mesh: MeshModel
    stencil_size: int

    @cached_property
    def adjacency(self) -> csr_array:
        """Binary, of shape (V, V)."""
        return adjacency_matrix(self.mesh.faces, self.mesh.n_verts)

    @cached_property
    def scales(self) -> list[Scale]:
        """The hierarchy of the vertices, from coarse to fine."""
        return build_hierarchy(self.adjacency, self.stencil_size)

    @cached_property
    def levels(self) -> list[Integers]:
        """Vertices of each level, all scales in a row."""
        return self.levels_of(slice(None))

    def levels_of(self, scales: slice) -> list[Integers]:
        """Vertices of each level of some scales."""
        return [level for scale in self.scales[scales] for level in scale.levels]

    @cached_property
    def stencils(self) -> Stencils:
        """Stencils of all levels, before anything is known."""
        return joined_stencils([smooth_stencils(scale) for scale in self.scales], self.stencil_size)

    @cached_property
    def passes(self) -> list[Pass]:
        """In which order the integers of a field are coded, and what tells of each."""
        sizes = np.array([len(scale.members) for scale in self.scales[:-1]])
        n_small = int(np.sum(SMALL_SCALE * sizes < self.mesh.n_verts))
        small = np.sort(np.concatenate([np.zeros(0, np.int64), *self.levels_of(slice(n_small))]))
        return [
            _pass(small, np.zeros((len(small), 0), np.int64)),
            *(_telling(scale) for scale in self.scales[n_small:-1]),
            *_telling_of_levels(self.scales[-1]),
        ]

    def predictors(self, weights: Floats) -> list[Predictor]:
        """Predictors of all levels, for weights of the stencils."""
        predictors, start = [], 0
        for level in self.levels:
            rows = slice(start, start + len(level))
            stencil = self.stencils.stencil[rows]
            is_there = stencil >= 0
            starts = np.concatenate([[0], np.cumsum(is_there.sum(axis=1))])
            matrix = csr_array(
                (weights[rows][is_there], stencil[is_there], starts),
                shape=(len(level), self.mesh.n_verts),
            )
            predictors.append(Predictor(level, matrix))
            start = rows.stop
        return predictors


def reconstruct_fields(
    mesh: FieldMesh,
    layout: Layout,
    steps_of: Callable[[slice, Sequence[Predictor]], StepsOf],
    taps_of: Callable[[slice, Floats, Floats], Integers] | None,
) -> Floats:
    """Decoded fields of shape (V, K).

    Parameters
    ----------
    mesh : FieldMesh
    layout : Layout
    steps_of : callable
        Gives what reads or chooses the integers of a group of modes with these predictors.
    taps_of : callable or None
        Gives the taps of a group, of shape (k, N_TAPS), for its fields of shape (V, k) and their
        differences of shape (N_TAPS, V, k). None: nothing is filtered.
    """
    n_verts, step = mesh.mesh.n_verts, float(layout.step)
    known = latest = np.zeros((n_verts, 0))
    learner = WeightLearner(mesh.stencils)
    for modes in layout.groups:
        predictors = mesh.predictors(learner.learn(latest, NOISE_OF_WEIGHTS * step**2))
        n_columns = modes.stop - modes.start
        values = reconstruct_levels(
            predictors, n_verts, n_columns, step, steps_of(modes, predictors)
        )
        latest = values
        if taps_of is not None:
            if known.shape[1] < N_FILTER_FIELDS:
                telling = np.hstack([known, values])[:, :N_FILTER_FIELDS]
                noise = NOISE_OF_FILTERS * step**2
                laplacian = reproducing_laplacian(mesh.adjacency, telling, noise)
            differences = _repeated(laplacian, values)
            taps = TAP_STEP * taps_of(modes, values, differences)
            latest = values + np.einsum("kt,tvk->vk", taps, differences)
        known = np.hstack([known, latest])
    return known


def reconstruct_times(n_frames: int, n_modes: int, steps_of: StepsOf) -> Floats:
    """Decoded time vectors of shape (3 T, K), each of length 1 (or 0)."""
    decoded = reconstruct_levels(time_predictors(n_frames), n_frames, 3 * n_modes, 1.0, steps_of)
    vectors = decoded.reshape(n_frames, n_modes, 3).transpose(2, 0, 1).reshape(-1, n_modes)
    lengths = np.linalg.norm(vectors, axis=0)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1.0))


@dataclass
class BlockFrames:
    """A block of frames with its trajectories, which do not change with the step.

    Attributes
    ----------
    matrices : float64 array of shape (3, T, V)
        Coordinate matrices, in internal vertex order.
    """

    matrices: Floats
    _found: tuple[float, Floats, Floats] | None = None

    def trajectories(self, least: float) -> tuple[Floats, Floats]:
        """Singular values above `least`, one at least, and time vectors of shape (3 T, K)."""
        if self._found is None or self._found[0] > least:
            n_frames, n_verts = self.matrices.shape[1:]
            limit = min(3 * n_frames, n_verts)
            self._found = (least, *joint_trajectories(self.matrices, limit, least))
        _, strengths, vectors = self._found
        n_kept = max(1, int(np.sum(strengths > least)))
        return strengths[:n_kept], vectors[:, :n_kept]


def analyse_fields(
    frames: BlockFrames, mesh: FieldMesh, choices: FieldChoices
) -> tuple[FieldBlock, Floats, Floats]:
    """A block of frames as integers, and what `synthesise_fields` makes of them.

    Parameters
    ----------
    frames : BlockFrames
    mesh : FieldMesh
    choices : FieldChoices

    Returns
    -------
    block : FieldBlock
    basis : float64 array of shape (3, T, K)
    fields : float64 array of shape (1, K, V)
    """
    matrices = frames.matrices
    n_frames = matrices.shape[1]
    step = np.float32(choices.position_step * np.sqrt(n_frames))
    times = _quantized_times(frames, float(step), choices)
    n_modes = times.shape[1] // 3
    vectors = reconstruct_times(n_frames, n_modes, _reading(time_predictors(n_frames), times))
    ends = group_ends(n_modes, choices.group_ends)
    layout = Layout(step, ends, choices.stencil_size)
    recorder = _Recorder(_projected(vectors, matrices), float(step), choices, mesh)
    taps_of = recorder.taps_of if choices.has_filters else None
    fields = reconstruct_fields(mesh, layout, recorder.steps_of, taps_of)
    block = FieldBlock(layout, times, recorder.integers.T, recorder.taps)
    return block, vectors.reshape(3, n_frames, n_modes), fields.T[None]


def synthesise_fields(block: FieldBlock, mesh: FieldMesh) -> tuple[Floats, Floats]:
    """Basis of shape (3, T, K) and fields of shape (1, K, V): frames are their product."""
    n_frames = len(block.times)
    vectors = reconstruct_times(
        n_frames, block.n_modes, _reading(time_predictors(n_frames), block.times)
    )

    def steps_of(modes: slice, _: Sequence[Predictor]) -> StepsOf:
        return lambda level, _: block.fields[modes, mesh.levels[level]].T

    def taps_of(modes: slice, *_: Floats) -> Integers:
        return block.taps[modes]

    # Taps of 0 change nothing, so that their differences are not worth their time.
    taken = taps_of if block.taps.any() else None
    fields = reconstruct_fields(mesh, block.layout, steps_of, taken)
    return vectors.reshape(3, n_frames, block.n_modes), fields.T[None]


def group_ends(n_modes: int, ends: Sequence[int]) -> tuple[int, ...]:
    """Ends of the groups of K modes, for the ends of all groups but the last."""
    return (*(end for end in ends if end < n_modes), n_modes)


def _telling(scale: Scale) -> Pass:
    """The levels of a scale in one pass; what tells of them are vertices of coarser scales."""
    order = np.argsort(scale.targets)
    targets, near = scale.targets[order], scale.stencil[order]
    return _pass(targets, np.where(np.isin(near, targets), -1, near))


def _telling_of_levels(scale: Scale) -> list[Pass]:
    """A pass for each level of a scale."""
    ends = np.cumsum([len(level) for level in scale.levels])
    near = np.split(scale.stencil, ends[:-1])
    return [_pass(level, one) for level, one in zip(scale.levels, near, strict=True)]


def _pass(targets: Integers, near: Integers) -> Pass:
    """A pass whose columns have the first few of those near them that are vertices, not -1."""
    is_there = near >= 0
    used = is_there & (np.cumsum(is_there, axis=1) <= N_TELLING)
    starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
    return Pass(targets, starts, near[used])


def _repeated(laplacian: csr_array, values: Floats) -> Floats:
    """The Laplacian applied once, twice, ...: of shape (N_TAPS, V, k)."""
    differences = [values]
    for _ in range(N_TAPS):
        differences.append(np.asarray(laplacian @ differences[-1]))
    return np.stack(differences[1:])


def _reading(predictors: Sequence[Predictor], integers: Integers) -> StepsOf:
    return lambda level, _: integers[predictors[level].rows]


def _projected(vectors: Floats, matrices: Floats) -> Floats:
    """Fields of shape (V, K) whose product with the time vectors is nearest to the frames."""
    gram = vectors.T @ vectors  # rounding leaves the vectors not quite orthonormal
    inverse = np.linalg.pinv(gram, hermitian=True)
    return np.asarray(matrices.reshape(len(vectors), -1).T @ (vectors @ inverse))


def _quantized_times(frames: BlockFrames, step: float, choices: FieldChoices) -> Integers:
    """Steps of the time vectors, of shape (T, 3 K), without modes that the steps make vanish."""
    n_frames, n_verts = frames.matrices.shape[1:]
    strengths, vectors = frames.trajectories(choices.least_rms * step * float(np.sqrt(n_verts)))
    strengths, vectors = strengths[: choices.n_modes], vectors[:, : choices.n_modes]
    n_kept = len(strengths)
    scaled = vectors * (strengths / (choices.basis_step * step))
    wanted = scaled.reshape(3, n_frames, n_kept).transpose(1, 2, 0).reshape(n_frames, -1)
    predictors = time_predictors(n_frames)
    integers = np.zeros(wanted.shape, np.int64)

    def steps_of(level: int, prediction: Floats) -> Integers:
        rows = predictors[level].rows
        price = choices.price if level else 0.0
        integers[rows] = quantize_by_rate(wanted[rows] - prediction, price)
        return integers[rows]

    reconstruct_times(n_frames, n_kept, steps_of)
    by_mode = integers.reshape(n_frames, n_kept, 3)
    does_something = np.asarray(by_mode.any(axis=(0, 2)))
    does_something[0] = True
    return by_mode[:, does_something].reshape(n_frames, -1)


@dataclass
class _Recorder:
    """The encoder's side of `reconstruct_fields`: chooses what it is asked for, and keeps it."""

    fields: Floats
    step: float
    choices: FieldChoices
    mesh: FieldMesh

    def __post_init__(self) -> None:
        n_modes = self.fields.shape[1]
        self.integers = np.zeros(self.fields.shape, np.int64)
        self.taps = np.zeros((n_modes, N_TAPS), np.int64)

    def steps_of(self, modes: slice, predictors: Sequence[Predictor]) -> StepsOf:
        """What chooses the integers of a group."""
        carrying = self.mesh.scales[
            max(0, len(self.mesh.scales) - self.choices.n_carrying_scales) :
        ]
        first_carrying = len(predictors) - sum(len(scale.levels) for scale in carrying)

        def chosen(level: int, prediction: Floats) -> Integers:
            rows = self.mesh.levels[level]
            wanted = self.fields[rows, modes]
            if level >= max(first_carrying, 1):
                true_prediction = predictors[level].weights @ self.fields[:, modes]
                wanted = wanted + self.choices.carried_share * (prediction - true_prediction)
            price = self.choices.price if level else 0.0
            steps = quantize_by_rate((wanted - prediction) / self.step, price)
            self.integers[rows, modes] = steps
            return steps

        return chosen

    def taps_of(self, modes: slice, values: Floats, differences: Floats) -> Integers:
        """Taps that bring each field nearest to the truth."""
        error = self.fields[:, modes] - values
        gram = np.einsum("avk,bvk->kab", differences, differences)
        moments = np.einsum("avk,vk->ka", differences, error)
        solved = np.linalg.pinv(gram, hermitian=True) @ moments[:, :, None]
        taps = np.clip(np.rint(solved[:, :, 0] / TAP_STEP), -MAX_TAP, MAX_TAP)
        self.taps[modes] = taps.astype(np.int64)
        return self.taps[modes]
