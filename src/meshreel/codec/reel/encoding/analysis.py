"""Analysis of a block of frames: its modes as integers."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.codec.reel.encoding.basis_coding import choose_coding
from meshreel.codec.reel.encoding.block_frames import CHUNK_VERTICES, LARGEST_INTEGER, BlockFrames
from meshreel.codec.reel.encoding.reuse import reuse_fields
from meshreel.codec.reel.normative.fields import (
    FieldBlock,
    KeyFields,
    Layout,
    decode_basis,
    with_reused,
)
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.kernel.basis import BasisCoding, basis_vectors, quantized_basis
from meshreel.kernel.frames import JointFrames
from meshreel.kernel.predict import Choice, Prepared, encode_values
from meshreel.runtime.profiling import staged
from meshreel.runtime.threads import chunks, in_background, in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

FAIR_PRICE = 2.0 * math.log(2.0) / 12.0
"""Lagrange multiplier of fine rounding: the squared error, in steps, that one more bit saves."""

MIN_SINGLE_STEP = 2.0**-16
"""Smallest step of positions, in diagonals, for single precision: its rounding, about 1e-7
diagonals, then adds less than 0.1 % to the squared error."""

MIN_RESTING_SHARE = 0.02
"""Least share of vertices at rest throughout a block for which its means become modes."""

MAX_OWN_RATIO = 0.25
"""With at most this many new modes per mode of the key, coding without the key is not tried."""


@dataclass(frozen=True)
class FieldChoices:
    """Encoder parameters.

    Attributes
    ----------
    position_step : float
        Step as it acts on a position, in diagonals; coefficients of T frames have sqrt(T) times
        this step.
    n_modes : int or None
        Largest number of modes; None for all that quantization does not zero.
    basis_step : float
        Step of the temporal basis by that of the fields, both as they act on positions.
    least_rms : float
        A mode is kept if its field's root mean square exceeds this share of a step.
    price : float
        Squared steps that a bit is worth.
    feedback_gain : float
        Gain of noise shaping: the share of the prediction error that the predicted value keeps
        instead of correcting it. Errors then vary smoothly over the mesh, which saves bits.
    n_shaped_resolutions : int
        Resolutions, the finest ones, where noise is shaped: from coarser ones it would spread far.
    stencil_size, n_learned
        As in `Layout`.
    """

    position_step: float
    n_modes: int | None = None
    basis_step: float = 3.0
    least_rms: float = 0.6
    price: float = FAIR_PRICE
    feedback_gain: float = 0.6
    n_shaped_resolutions: int = 2
    stencil_size: int = 16
    n_learned: int = 32


@dataclass(frozen=True)
class AnalysedFields:
    """A block of frames as integers.

    Attributes
    ----------
    block : FieldBlock
    decoded : JointFrames
        The frames that they decode to, in internal order.
    own : KeyFields
        Fields that are not reused, for blocks that refer to this one.
    wanted : float64 array of shape (V, K - n_reused)
        The unquantized fields, in the order of `own`.
    left : BlockFrames
        Residual frames after subtracting reused fields.
    """

    block: FieldBlock
    decoded: JointFrames
    own: KeyFields
    wanted: Floats
    left: BlockFrames

    @property
    def squared_error(self) -> float:
        """Sum of the squared distances of decoded positions, before they are rounded, from frames.

        The unquantized fields are the projection on the decoded basis; its residual is orthogonal
        to the error of the fields, so no frames are needed.
        """
        n_own = self.wanted.shape[1]
        if not n_own:
            return self.left.energy
        vectors = self.decoded.basis[:, :, self.block.layout.n_reused :].reshape(-1, n_own)
        gram = vectors.T @ vectors
        projected = float(np.vdot(self.wanted.T @ self.wanted, gram))
        error = self.wanted - self.own.values
        coded = float(np.vdot(error.T @ error, gram))
        return float(self.left.energy + self.decoded.step**2 * (coded - projected))

    @cached_property
    def cost(self) -> float:
        """Estimated bits of the integers, plus the bits that would correct the error.

        Estimates the entropy of each row from its mean magnitude.
        """
        block = self.block
        basis = block.basis.reshape(block.n_modes, -1)
        bits = _estimated_bits(basis) + _estimated_bits(block.fields)
        return bits + self.squared_error / self.decoded.step**2 / FAIR_PRICE


def _estimated_bits(rows: npt.NDArray[np.int32]) -> float:
    """Estimate the bits of rows of integers with geometrically distributed magnitudes."""
    if not rows.size:
        return 0.0
    mean = np.abs(rows.astype(np.float64)).mean(axis=1)
    magnitudes = np.log2(1.0 + mean) + mean * np.log2(1.0 + 1.0 / np.maximum(mean, 1e-300))
    return float(np.sum(magnitudes + mean / (1.0 + mean)) * rows.shape[1])


def analyse_fields(
    frames: BlockFrames,
    mesh: FieldMesh,
    choices: FieldChoices,
    key: KeyFields | None = None,
    reference: int = 0,
) -> AnalysedFields:
    """Return a block of frames as integers.

    Parameters
    ----------
    frames : BlockFrames
    mesh : FieldMesh
    choices : FieldChoices
    key : KeyFields, optional
        Fields of the block that this one refers to. They are reused if that takes fewer bits;
        modes are then found for the remainder.
    reference : int, default 0
        How many blocks the key precedes this one by.
    """
    n_frames = frames.n_frames
    step = np.float32(choices.position_step * np.sqrt(n_frames))
    is_trial = frames.is_analysed  # before, and not for the last time either
    # The first analysis also derives the hierarchy, in the background.
    hierarchy = None if is_trial else in_background(lambda: mesh.hierarchy)
    is_single = choices.position_step >= MIN_SINGLE_STEP
    layout = Layout(step, choices.stencil_size, choices.n_learned, reference, is_single)
    reused = None
    if key is not None:
        reused = _reusing(frames, mesh, choices, key, layout)
        n_own = 0 if reused is None else len(reused.block.fields)
        if reused is not None and n_own <= MAX_OWN_RATIO * key.values.shape[1]:
            return reused
    basis, vectors, coding = _quantized_basis(frames, float(step), choices)
    layout = _with_coding(layout, coding)
    if hierarchy is not None:
        hierarchy.result()
    prepared = mesh.prepared if key is None and is_trial else None
    alone = _with_basis(frames, basis, vectors, layout, mesh, choices, key, prepared)
    if reused is None:
        return alone
    return min(alone, reused, key=lambda one: one.cost)


@staged("fields")
def _with_basis(
    left: BlockFrames,
    basis: npt.NDArray[np.int32],
    vectors: Floats,
    layout: Layout,
    mesh: FieldMesh,
    choices: FieldChoices,
    key: KeyFields | None,
    prepared: Prepared | None = None,
    reused: npt.NDArray[np.int32] | None = None,
) -> AnalysedFields:
    """Return the integers of a block, given its basis and the vectors that this decodes to.

    `reused` is the basis of the modes whose fields are reused from the key.
    """
    step = float(layout.step)
    if len(basis):
        wanted = _projected(vectors.reshape(-1, len(basis)), left, mesh.number, step)
        residuals, own = _quantized_fields(wanted, layout, mesh, choices, key, prepared)
    else:
        wanted = np.empty((left.n_verts, 0))
        residuals, own = np.empty((0, left.n_verts), np.int32), KeyFields(wanted)
    whole = basis
    if reused is not None:
        whole = np.concatenate([reused, basis])
        vectors = decode_basis(whole, layout, key)
    values = own.values if reused is None else with_reused(own.values, layout.n_reused, key)
    decoded = JointFrames(vectors, values, step, mesh.number, layout.is_single)
    return AnalysedFields(FieldBlock(layout, whole, residuals), decoded, own, wanted, left)


def _reusing(
    frames: BlockFrames, mesh: FieldMesh, choices: FieldChoices, key: KeyFields, layout: Layout
) -> AnalysedFields | None:
    """Encode a block with reused fields of its key and modes of the residual, if possible."""
    if choices.n_modes is not None:  # a given number of modes excludes those of the key
        return None
    finer, step = np.float32(choices.basis_step), float(layout.step)
    reused = reuse_fields(frames, key.values, mesh.number, step, float(finer), choices.price)
    if reused is None:
        return None
    coding = reused.coding
    basis, vectors, _ = _quantized_basis(reused.left, step, choices, coding, may_be_none=True)
    n_reused = len(reused.integers)
    if n_reused + len(basis) > frames.n_columns * frames.n_frames:
        return None
    layout = replace(layout, n_reused=n_reused, finer=finer)
    layout = _with_coding(layout, coding)
    left, integers = reused.left, reused.integers
    return _with_basis(left, basis, vectors, layout, mesh, choices, key, None, integers)


def _projected(vectors: Floats, frames: BlockFrames, places: Integers, step: float) -> Floats:
    """Return fields of shape (V, K), in steps, whose product with the basis is nearest to frames.

    `places` is the row of each vertex.
    """
    gram = vectors.T @ vectors  # rounding leaves the vectors not quite orthonormal
    inverse = np.linalg.pinv(gram, hermitian=True) @ vectors.T
    fields = np.empty((frames.n_verts, vectors.shape[1]))

    def fill(piece: slice) -> None:
        fields[places[piece]] = (inverse @ frames.coordinates(piece)).T / step

    in_threads(fill, chunks(len(fields), CHUNK_VERTICES))
    return fields


def _quantized_basis(
    frames: BlockFrames,
    step: float,
    choices: FieldChoices,
    coding: BasisCoding | None = None,
    *,
    may_be_none: bool = False,
) -> tuple[npt.NDArray[np.int32], Floats, BasisCoding]:
    """Return integers of the temporal basis (K, C, T), the vectors they decode to, and the coding.

    Modes whose integers are all 0 are dropped; one mode remains unless `may_be_none`. The coding is
    chosen if it is not given.
    """
    least = choices.least_rms * step * float(np.sqrt(frames.n_verts))
    has_means = frames.subtracted is None and has_resting_vertices(frames, step)
    strengths, vectors = frames.trajectories(least, with_means=has_means)
    if may_be_none:
        vectors = vectors[:, strengths > least]
        strengths = strengths[strengths > least]
    strengths, vectors = strengths[: choices.n_modes], vectors[:, : choices.n_modes]
    # Decoded vectors are normalized, so the stream need not store a coarser step.
    scales = np.minimum(strengths / (choices.basis_step * step), LARGEST_INTEGER)
    shape = (-1, frames.n_columns, frames.n_frames)
    wanted = (vectors * scales).T.reshape(shape)
    if coding is None:
        coding = choose_coding(frames, wanted, step, choices.basis_step, choices.price)
    coded, decoded = quantized_basis(wanted, choices.price, coding)
    does_something = np.asarray(coded.any(axis=(1, 2)))
    if not may_be_none:
        does_something[0] = True
    if not does_something.all():
        coded = coded[does_something]
        decoded = basis_vectors(coded, coding)
    return coded, decoded, coding


def has_resting_vertices(frames: BlockFrames, step: float) -> bool:
    """Return whether some vertices, not all, rest throughout a block; `step` is that of its fields.

    Basis vectors of the means, which are constant, then keep these vertices in place.
    """
    _, ranges = frames.sampled_motion
    share = float(np.mean(ranges < step / math.sqrt(frames.n_frames)))
    return MIN_RESTING_SHARE <= share < 1.0


def _quantized_fields(
    wanted: Floats,
    layout: Layout,
    mesh: FieldMesh,
    choices: FieldChoices,
    key: KeyFields | None,
    prepared: Prepared | None,
) -> tuple[npt.NDArray[np.int32], KeyFields]:
    """Residuals of shape (K, V), and the fields that they decode to, both in coding order.

    Parameters
    ----------
    wanted : float64 array of shape (V, K)
        Unquantized fields, in coding order and in steps.
    prepared : Prepared or None
        Initial weights, if known, without a key.
    """
    choice = Choice(_first_shaped(mesh, choices), choices.feedback_gain, choices.price)
    known = None
    if key is not None:
        known, prepared = key.values, key.prepared(mesh, layout.n_learned)
    residuals, values = encode_values(
        mesh.hierarchy, wanted, choice, layout.n_learned, known, prepared
    )
    return residuals, KeyFields(values)


def _first_shaped(mesh: FieldMesh, choices: FieldChoices) -> int:
    """Return the first level with noise shaping: of the finest resolutions, but not level 0."""
    resolution_of = mesh.hierarchy.level_resolutions
    first = resolution_of[-1] + 1 - choices.n_shaped_resolutions
    return max(1, int(np.searchsorted(resolution_of, first)))


def _with_coding(layout: Layout, coding: BasisCoding) -> Layout:
    return replace(
        layout,
        rests=coding.rests,
        has_cosines=coding.has_cosines,
        is_adaptive=coding.is_adaptive,
    )
