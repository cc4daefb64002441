"""The encoder's side of `reel`: a block of frames to the integers of its modes."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.reel.agreed.closed_loop import ClosedLoop
from meshreel.reel.agreed.fields import (
    MAX_TAP,
    N_TAPS,
    TAP_STEP,
    FieldBlock,
    FieldLoop,
    KeyFields,
    Layout,
    decode_basis,
    group_ends,
)
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.reel.agreed.timeline import time_predictors
from meshreel.reel.encoding.rate_distortion import FAIR_PRICE, quantize_by_rate
from meshreel.runtime.profiling import staged
from meshreel.runtime.threads import chunks, in_background, in_threads
from meshreel.subspace.pca import joint_trajectories

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

CHUNK_VERTICES = 2048
"""Vertices whose fields are found at once."""

LARGEST_FEEDBACK = 8.0
"""Quantisation steps of noise feedback beyond which there is none: real motion asks for up to 5.5,
and weights that amplify rounding would ask for more from level to level."""


@dataclass(frozen=True)
class FieldChoices:
    """Choices of the encoder.

    Attributes
    ----------
    position_step : float
        Step as it acts on a position, in diagonals; coefficients of T frames have sqrt(T) times
        this step.
    n_modes : int or None
        At most this many; None for all that the step does not make vanish.
    basis_step : float
        Step of the temporal basis by that of the fields, both as they act on positions.
    least_rms : float
        A mode is kept if its field's root mean square exceeds this share of a step.
    price : float
        Squared steps that a bit is worth.
    feedback_gain : float
        Gain of noise shaping: the share of the error of a prediction that the predicted value takes
        on instead of undoing it. Errors then vary smoothly over the mesh, and bits are saved.
    n_shaped_resolutions : int
        Resolutions, the finest ones, where noise is shaped: from coarser ones it would spread far.
    has_filters : bool
        Smooth decoded fields.
    group_ends, stencil_size
        As in `Layout`; the last group takes the modes that are left.
    later_group_ends : tuple of int
        Those of blocks that refer to a key block, whose weights are good from the first mode on.
    """

    position_step: float
    n_modes: int | None = None
    basis_step: float = 3.0
    least_rms: float = 0.6
    price: float = FAIR_PRICE
    feedback_gain: float = 0.6
    n_shaped_resolutions: int = 2
    has_filters: bool = True
    group_ends: tuple[int, ...] = (1, 2, 3, 4, 6, 10)
    stencil_size: int = 10
    later_group_ends: tuple[int, ...] = (4,)


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

    @staged("trajectories")
    def trajectories(self, least: float) -> tuple[Floats, Floats]:
        """Singular values above `least`, one at least, and basis vectors of shape (3 T, K)."""
        if self._found is None or self._found[0] > least:
            n_frames, n_verts = self.matrices.shape[1:]
            limit = min(3 * n_frames, n_verts)
            self._found = (least, *joint_trajectories(self.matrices, limit, least))
        _, strengths, vectors = self._found
        n_kept = max(1, int(np.sum(strengths > least)))
        return strengths[:n_kept], vectors[:, :n_kept]


def analyse_fields(
    frames: BlockFrames,
    mesh: FieldMesh,
    choices: FieldChoices,
    key: KeyFields | None = None,
    reference: int = 0,
) -> tuple[FieldBlock, Floats, Floats]:
    """A block of frames as integers, and the basis and fields that they decode to.

    Parameters
    ----------
    frames : BlockFrames
    mesh : FieldMesh
    choices : FieldChoices
    key : KeyFields, optional
        Of the block that this one is to refer to.
    reference : int, default 0
        How many blocks before this one that is.

    Returns
    -------
    block : FieldBlock
    basis : float64 array of shape (3, T, K)
    fields : float64 array of shape (1, K, V)
    """
    matrices = frames.matrices
    n_frames = matrices.shape[1]
    step = np.float32(choices.position_step * np.sqrt(n_frames))
    stencils = in_background(lambda: mesh.stencils)  # where they are not known yet
    basis = _quantized_basis(frames, float(step), choices)
    n_modes = basis.shape[1] // 3
    vectors = decode_basis(basis)
    ends = group_ends(n_modes, choices.later_group_ends if key else choices.group_ends)
    layout = Layout(step, ends, choices.stencil_size, reference)
    stencils.result()
    wanted = _projected(vectors, matrices)
    residuals, taps, fields = _quantized_fields(wanted, layout, mesh, choices, key)
    block = FieldBlock(layout, basis, residuals, taps)
    return block, vectors.reshape(3, n_frames, n_modes), fields.T[None]


@staged("projection")
def _projected(vectors: Floats, matrices: Floats) -> Floats:
    """Fields of shape (V, K) whose product with the temporal basis is nearest to the frames."""
    gram = vectors.T @ vectors  # rounding leaves the vectors not quite orthonormal
    inverse = np.linalg.pinv(gram, hermitian=True) @ vectors.T
    stacked = matrices.reshape(len(vectors), -1)
    fields = np.empty((stacked.shape[1], vectors.shape[1]))

    def fill(piece: slice) -> None:
        fields[piece] = (inverse @ stacked[:, piece]).T

    in_threads(fill, chunks(len(fields), CHUNK_VERTICES))
    return fields


@staged("temporal basis")
def _quantized_basis(frames: BlockFrames, step: float, choices: FieldChoices) -> Integers:
    """Residuals of the temporal basis, of shape (T, 3 K), without modes that are all 0."""
    n_frames, n_verts = frames.matrices.shape[1:]
    strengths, vectors = frames.trajectories(choices.least_rms * step * float(np.sqrt(n_verts)))
    strengths, vectors = strengths[: choices.n_modes], vectors[:, : choices.n_modes]
    n_kept = len(strengths)
    scaled = vectors * (strengths / (choices.basis_step * step))
    wanted = scaled.reshape(3, n_frames, n_kept).transpose(1, 2, 0).reshape(n_frames, -1)
    predictors = time_predictors(n_frames)
    loop = ClosedLoop(predictors, n_frames, wanted.shape[1], 1.0)
    integers = np.zeros(wanted.shape, np.int64)
    for level, predictor in enumerate(predictors):
        prediction = loop.predict(level)
        price = choices.price if level else 0.0
        residuals = quantize_by_rate(wanted[predictor.rows] - prediction, price)
        loop.add(level, prediction, residuals)
        integers[predictor.rows] = residuals
    by_mode = integers.reshape(n_frames, n_kept, 3)
    does_something = np.asarray(by_mode.any(axis=(0, 2)))
    does_something[0] = True
    return by_mode[:, does_something].reshape(n_frames, -1)


@staged("fields")
def _quantized_fields(
    wanted: Floats,
    layout: Layout,
    mesh: FieldMesh,
    choices: FieldChoices,
    key: KeyFields | None,
) -> tuple[Integers, Integers, Floats]:
    """Residuals of shape (K, V), taps of shape (K, N_TAPS), and the fields that they decode to.

    Parameters
    ----------
    wanted : float64 array of shape (V, K)
        The fields to come near to. Those they decode to have the same shape.
    """
    n_verts, n_modes = wanted.shape
    integers = np.zeros((n_verts, n_modes), np.int64)
    taps = np.zeros((n_modes, N_TAPS), np.int64)
    shaped = _shaped_levels(mesh, choices)
    loop = FieldLoop(mesh, layout, key)
    for group in layout.groups:
        fields = np.ascontiguousarray(wanted[:, group])
        levels = loop.learn(group)
        for level, rows in enumerate(mesh.levels):
            prediction = levels.predict(level)
            aimed = fields[rows]
            if level in shaped:
                true_prediction = levels.predictors[level].weights @ fields
                aimed = aimed + _feedback(prediction - true_prediction, layout, choices)
            price = choices.price if level else 0.0
            residuals = quantize_by_rate((aimed - prediction) / float(layout.step), price)
            levels.add(level, prediction, residuals)
            integers[rows, group] = residuals
        if choices.has_filters:
            taps[group] = _best_taps(fields - levels.values, loop.differences())
        loop.finish(taps[group] if choices.has_filters else None)
    return integers.T, taps, loop.fields


def _shaped_levels(mesh: FieldMesh, choices: FieldChoices) -> range:
    """Levels whose noise is shaped: those of the finest resolutions, but never the first."""
    n_plain = max(0, len(mesh.resolutions) - choices.n_shaped_resolutions)
    first = len(mesh.levels_of(slice(n_plain)))
    return range(max(first, 1), len(mesh.levels))


def _feedback(prediction_error: Floats, layout: Layout, choices: FieldChoices) -> Floats:
    """The share of the error of predictions that predicted values take on."""
    feedback = choices.feedback_gain * prediction_error
    feedback[np.abs(feedback) > LARGEST_FEEDBACK * float(layout.step)] = 0.0
    return feedback


def _best_taps(error: Floats, differences: Floats) -> Integers:
    """Taps of shape (k, N_TAPS) that bring fields nearest to the truth, for their error (V, k)."""
    gram = np.einsum("avk,bvk->kab", differences, differences)
    moments = np.einsum("avk,vk->ka", differences, error)
    solved = np.linalg.pinv(gram, hermitian=True) @ moments[:, :, None]
    taps = np.clip(np.rint(solved[:, :, 0] / TAP_STEP), -MAX_TAP, MAX_TAP)
    return np.asarray(taps, np.int64)
