"""Analysis of a block of frames: its modes as integers, or as reused fields of a key block."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.codec.reel.encoding.basis_coding import choose_coding, geometric_bits
from meshreel.codec.reel.encoding.block_frames import CHUNK_VERTICES, LARGEST_INTEGER, BlockFrames
from meshreel.codec.reel.encoding.surface_errors import surface_forms
from meshreel.codec.reel.normative.fields import FieldBlock, Layout, PointWeights, decode_basis
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.kernel.basis import BasisCoding, basis_vectors, lengths_of, quantized_basis
from meshreel.kernel.frames import JointFrames
from meshreel.kernel.predict import Choice, encode_values
from meshreel.runtime.threads import chunks, in_chunks, in_threads

LAGRANGE_MULTIPLIER = 2.0 * math.log(2.0) / 12.0
"""Squared error, in squared steps, that one more bit saves at fine quantization."""

MIN_SINGLE_STEP = 2.0**-16
"""Smallest step of positions, in diagonals, for single precision: its rounding, about 1e-7
diagonals, then adds less than 0.1 % to the squared error."""

MIN_RESTING_SHARE = 0.02
"""Minimum share of vertices at rest throughout a block; above it, means over time become modes."""

MAX_NEW_RATIO = 0.25
"""Up to this ratio of new modes to modes of the key, coding without the key is not tried."""


@dataclass(frozen=True)
class FieldChoices:
    """Encoder parameters."""

    position_step: float
    """Step as it acts on a position, in diagonals; coefficients of T frames have sqrt(T) times this
    step.
    """
    n_modes: int | None = None
    """Maximum number of modes; None: all that are not quantized to zero."""
    basis_step: float = 3.0
    """Step of the temporal basis divided by that of the fields, both as they act on positions."""
    least_rms: float = 0.6
    """A mode is kept if the root mean square of its field exceeds this share of a step."""
    rate_weight: float = LAGRANGE_MULTIPLIER
    """Lagrange multiplier: squared error, in squared steps, per bit; 0 rounds to the nearest."""
    feedback_gain: float = 0.6
    """Gain of noise shaping: the share of the prediction error that the predicted value keeps
    instead of correcting it. Errors then vary smoothly over the mesh, which saves bits.
    """
    n_shaped_resolutions: int = 2
    """Number of resolutions with shaped noise, starting with the finest: from coarser ones it would
    spread far.
    """
    stencil_size: int = 16
    n_learned: int = 32
    """Number of modes to which the prediction weights adapt."""
    slides: bool = False
    """Whether vertices may slide along the surface."""


@dataclass(frozen=True)
class AnalyzedFields:
    """A block of frames as integers."""

    block: FieldBlock
    decoded: JointFrames
    """The decoded frames, in internal order."""
    new_fields: Floats
    """float64 array of shape (V, K - n_reused). Fields that are not reused, in coding order and in
    steps; other blocks may reuse them.
    """
    target: Floats
    """float64 array of shape (V, K - n_reused). The new fields before quantization, in the same
    order.
    """
    remainder: BlockFrames
    """Residual frames after subtracting reused fields."""

    @property
    def squared_error(self) -> float:
        """Sum of the squared distances of decoded positions, before they are rounded, from frames.

        The unquantized fields are the projection on the decoded basis; its residual is orthogonal
        to the error of the fields, so no frames are needed.
        """
        n_new = self.target.shape[1]
        if not n_new:
            return self.remainder.energy
        vectors = self.decoded.basis[:, :, self.block.layout.n_reused :].reshape(-1, n_new)
        gram = vectors.T @ vectors
        projected = float(np.vdot(self.target.T @ self.target, gram))
        error = self.target - self.new_fields
        coded = float(np.vdot(error.T @ error, gram))
        return float(self.remainder.energy + self.decoded.step**2 * (coded - projected))

    @cached_property
    def cost(self) -> float:
        """Estimated bits of the integers, plus the bits that would correct the error.

        Estimates the entropy of each row from its mean magnitude.
        """
        block = self.block
        basis = block.basis.reshape(block.n_modes, -1)
        bits = _estimated_bits(basis) + _estimated_bits(block.fields)
        return bits + self.squared_error / self.decoded.step**2 / LAGRANGE_MULTIPLIER


def _estimated_bits(rows: npt.NDArray[np.int32]) -> float:
    """Estimate the bits of rows of integers with geometrically distributed magnitudes."""
    if not rows.size:
        return 0.0
    mean = np.abs(rows.astype(np.float64)).mean(axis=1)
    return float(np.sum(geometric_bits(mean)) * rows.shape[1])


def analyze_fields(
    frames: BlockFrames,
    mesh: FieldMesh,
    choices: FieldChoices,
    key: Floats | None = None,
    reference: int = 0,
) -> AnalyzedFields:
    """Return a block of frames as integers.

    Parameters
    ----------
    key : float64 array of shape (V, K), optional
        Fields of the block that this one refers to, in coding order and in steps. They are reused
        if that takes fewer bits; new modes then code the remainder.
    reference : int, default 0
        Number of blocks from the key to this one.
    """
    n_frames = frames.n_frames
    step = np.float32(choices.position_step * np.sqrt(n_frames))
    is_single = choices.position_step >= MIN_SINGLE_STEP
    layout = Layout(step, choices.stencil_size, choices.n_learned, reference, is_single)
    if frames.from_points is not None:
        points = frames.from_points
        layout = replace(layout, nugget=points.code, related=points.related)
    reused = None
    if key is not None:
        reused = _analyze_reusing(frames, mesh, choices, key, layout)
        n_new = 0 if reused is None else len(reused.block.fields)
        if reused is not None and n_new <= MAX_NEW_RATIO * key.shape[1]:
            return reused
    basis, vectors, coding = _quantized_basis(frames, float(step), choices)
    layout = replace(layout, coding=coding)
    without_reuse = _encode_fields(frames, basis, vectors, layout, mesh, choices, key)
    if reused is None:
        return without_reuse
    return min(without_reuse, reused, key=lambda analyzed: analyzed.cost)


def _encode_fields(
    frames: BlockFrames,
    basis: npt.NDArray[np.int32],
    vectors: Floats,
    layout: Layout,
    mesh: FieldMesh,
    choices: FieldChoices,
    key: Floats | None,
    reused: npt.NDArray[np.int32] | None = None,
) -> AnalyzedFields:
    """Quantize the fields of frames, given the integers of the basis and their decoded vectors.

    `reused` are the integers of the vectors of reused modes.
    """
    step = float(layout.step)
    if len(basis):
        target = _projected(vectors.reshape(-1, len(basis)), frames, mesh.number, step)
        forms = None
        if choices.slides:
            forms = surface_forms(vectors, target, frames, mesh, layout.n_learned)
        residuals, new_fields = quantized_fields(
            target, mesh, choices, frames.from_points, key, forms
        )
    else:
        target = np.empty((frames.n_verts, 0))
        residuals, new_fields = np.empty((0, frames.n_verts), np.int32), target
    values = new_fields
    if reused is not None and key is not None:
        basis = np.concatenate([reused, basis])
        vectors = decode_basis(basis, layout, key)
        values = np.concatenate([key[:, : layout.n_reused], new_fields], axis=1)
    decoded = JointFrames(vectors, values, step, mesh.number, layout.is_single)
    return AnalyzedFields(FieldBlock(layout, basis, residuals), decoded, new_fields, target, frames)


def _analyze_reusing(
    frames: BlockFrames, mesh: FieldMesh, choices: FieldChoices, key: Floats, layout: Layout
) -> AnalyzedFields | None:
    """Encode a block with reused fields of its key and modes of the residual, if possible."""
    if choices.n_modes is not None:  # an option for the number of modes excludes those of the key
        return None
    finer, step = np.float32(choices.basis_step), float(layout.step)
    max_modes = frames.n_columns * frames.n_frames
    n_reused = min(key.shape[1], max_modes)
    fields = np.ascontiguousarray(key[mesh.number, :n_reused])
    lengths = lengths_of(key, n_reused, float(finer))

    # Least-squares vectors, of shape (C T, R), that fit frames with these fields.
    pieces = chunks(frames.n_verts, CHUNK_VERTICES)
    products = in_threads(lambda piece: frames.coordinates(piece) @ fields[piece], pieces)
    inverse = np.linalg.pinv(fields.T @ fields, hermitian=True)
    fitted: Floats = sum(products[1:], products[0]) @ inverse
    scaled = fitted / step * lengths
    if not np.abs(scaled).max() < LARGEST_INTEGER:
        return None
    scaled = scaled.T.reshape(n_reused, frames.n_columns, frames.n_frames)
    coding = choose_coding(frames, scaled, step, float(finer), choices.rate_weight)
    integers, _ = quantized_basis(scaled, choices.rate_weight, coding)
    used_modes = np.flatnonzero(integers.any(axis=(1, 2)))
    if not len(used_modes):
        return None
    n_reused = int(used_modes[-1]) + 1
    integers = np.ascontiguousarray(integers[:n_reused])

    reused = basis_vectors(integers, coding, lengths[:n_reused]) * step
    remainder = BlockFrames(
        frames.vertices,
        frames.frame,
        frames.order,
        (reused, np.ascontiguousarray(fields[:, :n_reused])),
        frames.from_points,
    )
    basis, vectors, _ = _quantized_basis(remainder, step, choices, coding, may_be_none=True)
    if n_reused + len(basis) > max_modes:
        return None
    layout = replace(layout, n_reused=n_reused, finer=finer, coding=coding)
    return _encode_fields(remainder, basis, vectors, layout, mesh, choices, key, integers)


def _projected(vectors: Floats, frames: BlockFrames, rows: Integers, step: float) -> Floats:
    """Return fields of shape (V, K), in steps, whose product with the basis is nearest to frames.

    `rows` is the row of each vertex.
    """
    gram = vectors.T @ vectors  # rounding leaves the vectors not quite orthonormal
    inverse = np.linalg.pinv(gram, hermitian=True) @ vectors.T
    fields = np.empty((frames.n_verts, vectors.shape[1]))

    def fill(piece: slice) -> None:
        fields[rows[piece]] = (inverse @ frames.coordinates(piece)).T / step

    in_chunks(fill, len(fields), CHUNK_VERTICES)
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
    target = (vectors * scales).T.reshape(shape)
    if coding is None:
        coding = choose_coding(frames, target, step, choices.basis_step, choices.rate_weight)
    coded, decoded = quantized_basis(target, choices.rate_weight, coding)
    is_used = np.asarray(coded.any(axis=(1, 2)))
    if not may_be_none:
        is_used[0] = True
    if not is_used.all():
        coded = coded[is_used]
        decoded = basis_vectors(coded, coding)
    return coded, decoded, coding


def has_resting_vertices(frames: BlockFrames, step: float) -> bool:
    """Return whether some vertices, not all, rest throughout a block; `step` is that of its fields.

    Basis vectors of the means, which are constant, then keep these vertices in place.
    """
    _, ranges = frames.sampled_motion
    share = float(np.mean(ranges < step / math.sqrt(frames.n_frames)))
    return MIN_RESTING_SHARE <= share < 1.0


def field_targets(frames: BlockFrames, mesh: FieldMesh, choices: FieldChoices) -> Floats:
    """Return the unquantized fields of a block, of shape (V, K), in coding order and in steps."""
    step = float(np.float32(choices.position_step * np.sqrt(frames.n_frames)))
    basis, vectors, _ = _quantized_basis(frames, step, choices)
    return _projected(vectors.reshape(-1, len(basis)), frames, mesh.number, step)


def quantized_fields(
    target: Floats,
    mesh: FieldMesh,
    choices: FieldChoices,
    from_points: PointWeights | None,
    key: Floats | None = None,
    forms: npt.NDArray[np.float32] | None = None,
) -> tuple[npt.NDArray[np.int32], Floats]:
    """Residuals of shape (K, V), and the fields that they decode to, both in coding order.

    Parameters
    ----------
    target : float64 array of shape (V, K)
        Unquantized fields, in coding order and in steps.
    from_points : PointWeights or None
        Initial weights; None derives them from connectivity.
    forms : float32 array or None
        As in `encode_values`.
    """
    # Noise is shaped in the finest resolutions, but never in level 0.
    resolution_of = mesh.hierarchy.level_resolutions
    first = resolution_of[-1] + 1 - choices.n_shaped_resolutions
    first_shaped = max(1, int(np.searchsorted(resolution_of, first)))
    choice = Choice(first_shaped, choices.feedback_gain, choices.rate_weight)
    weights = related = None
    if from_points is not None:
        weights, related = from_points.weights, from_points.fields
    arrays = key, forms, weights, related
    return encode_values(mesh.hierarchy, target, choice, choices.n_learned, *arrays)
