"""The encoder's side of `reel`: a block of frames to the integers of its modes."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.codec.frame_products import JointFrames
from meshreel.connectivity.permutation import inverse_permutation
from meshreel.kernel.frames import coordinate_rows, encode_times
from meshreel.kernel.predict import Choice, Prepared, encode_values
from meshreel.reel.agreed.fields import FieldBlock, KeyFields, Layout, decode_basis
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.runtime.profiling import staged
from meshreel.runtime.threads import chunks, in_background, in_threads
from meshreel.subspace.pca import gram_of_rows, joint_trajectories, leading_trajectories
from meshreel.subspace.trajectories import BoundingFrame

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

FAIR_PRICE = 2.0 * math.log(2.0) / 12.0
"""Lagrange multiplier of fine rounding: the squared steps of error that one more bit saves."""

MOST_KEPT = 1 << 23
"""Coordinates that are kept as float64; those of larger blocks are found anew where needed."""

LEAST_SINGLE_STEP = 2.0**-16
"""Step on a position, in diagonals, from which on frames are summed up in single precision: its
rounding, some 1e-7 diagonals, then adds less than 0.1 % to the squared error."""

CHUNK_VERTICES = 2048
"""Vertices whose fields are found at once."""


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


@dataclass
class BlockFrames:
    """A block of frames with its trajectories, which do not change with the step.

    Attributes
    ----------
    vertices : float array of shape (T, V, C)
        Positions, or values of another track; contiguous.
    frame : BoundingFrame
        What they are relative to.
    order : int32 array of shape (V,), or None
        Number of each vertex in the internal order; None: they are in it.
    """

    vertices: npt.NDArray[np.floating]
    frame: BoundingFrame
    order: npt.NDArray[np.int32] | None = None
    _found: tuple[float, Floats, Floats] | None = None

    @property
    def n_frames(self) -> int:
        """T."""
        return int(self.vertices.shape[0])

    @property
    def n_verts(self) -> int:
        """V."""
        return int(self.vertices.shape[1])

    @property
    def n_columns(self) -> int:
        """C."""
        return int(self.vertices.shape[2])

    def coordinates(self, piece: slice, frames: slice = slice(None)) -> Floats:
        """Coordinates of some vertices, in internal order: of shape (C T, n), x before y and z."""
        if self._is_small and frames == slice(None):
            return self._all[:, piece]
        return coordinate_rows(self.vertices[frames], self.order, piece, self.frame.placement)

    @property
    def _is_small(self) -> bool:
        return self.vertices.size <= MOST_KEPT

    @cached_property
    @staged("coordinates")
    def _all(self) -> Floats:
        everything = slice(0, self.n_verts)
        return coordinate_rows(self.vertices, self.order, everything, self.frame.placement)

    @cached_property
    def _gram(self) -> Floats:
        return gram_of_rows(self.coordinates, self._n_rows, self.n_verts)

    @property
    def _n_rows(self) -> int:
        return self.n_columns * self.n_frames

    @property
    def is_analysed(self) -> bool:
        """Whether trajectories were found before."""
        return self._found is not None

    @cached_property
    def energy(self) -> float:
        """Sum of all squared coordinates."""
        if self._n_rows <= self.n_verts:
            return float(np.trace(self._gram))
        pieces = chunks(self.n_verts, CHUNK_VERTICES)
        return sum(float(np.square(self.coordinates(piece)).sum()) for piece in pieces)

    @cached_property
    def spread(self) -> float:
        """Sum of the squared distances of all positions from the mean of their frame."""
        first = self.coordinates(slice(0, 1))  # vertices in one place have no spread at all
        sums, total = np.zeros(len(first)), 0.0
        for piece in chunks(self.n_verts, CHUNK_VERTICES):
            around = self.coordinates(piece) - first
            sums += around.sum(axis=1)
            total += float(np.vdot(around, around))
        return total - float(sums @ sums) / self.n_verts

    @staged("trajectories")
    def trajectories(self, least: float) -> tuple[Floats, Floats]:
        """Singular values above `least`, one at least, and basis vectors of shape (C T, K)."""
        if self._found is None or self._found[0] > least:
            limit = min(self._n_rows, self.n_verts)
            if limit == self.n_verts:
                rows = self.coordinates(slice(0, limit)).reshape(self.n_columns, -1, limit)
                self._found = (least, *joint_trajectories(rows, limit, least))
            else:
                self._found = (least, *leading_trajectories(self._gram, limit, least))
        _, strengths, vectors = self._found
        n_kept = max(1, int(np.sum(strengths > least)))
        return strengths[:n_kept], vectors[:, :n_kept]


@dataclass(frozen=True)
class AnalysedFields:
    """A block of frames as integers.

    Attributes
    ----------
    block : FieldBlock
    decoded : JointFrames
        The frames that they decode to, in internal order.
    own : KeyFields
        What blocks that refer to this one go by.
    wanted : float64 array of shape (V, K)
        The fields that were to be come near to, as `own`.
    """

    block: FieldBlock
    decoded: JointFrames
    own: KeyFields
    wanted: Floats

    def squared_error(self, energy: float) -> float:
        """Sum of the squared distances of decoded positions, before they are rounded, from frames.

        The wanted fields are those of the projection on the decoded basis: what it leaves, and
        what the fields differ by, are at right angles. That needs no frames.

        Parameters
        ----------
        energy : float
            `BlockFrames.energy`.
        """
        vectors = self.decoded.basis.reshape(-1, self.block.n_modes)
        gram = vectors.T @ vectors
        projected = float(np.vdot(self.wanted.T @ self.wanted, gram))
        error = self.wanted - self.own.values
        coded = float(np.vdot(error.T @ error, gram))
        return energy + self.decoded.step**2 * (coded - projected)


def analyse_fields(
    frames: BlockFrames,
    mesh: FieldMesh,
    choices: FieldChoices,
    key: KeyFields | None = None,
    reference: int = 0,
) -> AnalysedFields:
    """A block of frames as integers.

    Parameters
    ----------
    frames : BlockFrames
    mesh : FieldMesh
    choices : FieldChoices
    key : KeyFields, optional
        Of the block that this one is to refer to.
    reference : int, default 0
        How many blocks before this one that is.
    """
    n_frames = frames.n_frames
    step = np.float32(choices.position_step * np.sqrt(n_frames))
    is_trial = frames.is_analysed  # before, and not for the last time either
    hierarchy = in_background(lambda: mesh.hierarchy)  # where it is not known yet
    basis = _quantized_basis(frames, float(step), choices)
    n_modes = len(basis)
    vectors = decode_basis(basis)
    is_single = choices.position_step >= LEAST_SINGLE_STEP
    layout = Layout(step, choices.stencil_size, choices.n_learned, reference, is_single)
    hierarchy.result()
    wanted = _projected(vectors.reshape(-1, n_modes), frames, mesh.order, float(step))
    prepared = mesh.prepared if key is None and is_trial else None
    residuals, own = _quantized_fields(wanted, layout, mesh, choices, key, prepared)
    decoded = JointFrames(vectors, own.values, float(step), mesh.number, is_single)
    return AnalysedFields(FieldBlock(layout, basis, residuals), decoded, own, wanted)


@staged("projection")
def _projected(
    vectors: Floats, frames: BlockFrames, order: npt.NDArray[np.int32], step: float
) -> Floats:
    """Fields of shape (V, K) whose product with the temporal basis is nearest to the frames.

    In this order of vertices, and in steps.
    """
    gram = vectors.T @ vectors  # rounding leaves the vectors not quite orthonormal
    inverse = np.linalg.pinv(gram, hermitian=True) @ vectors.T
    fields = np.empty((frames.n_verts, vectors.shape[1]))
    places = inverse_permutation(order)

    def fill(piece: slice) -> None:
        fields[places[piece]] = (inverse @ frames.coordinates(piece)).T / step

    in_threads(fill, chunks(len(fields), CHUNK_VERTICES))
    return fields


@staged("temporal basis")
def _quantized_basis(
    frames: BlockFrames, step: float, choices: FieldChoices
) -> npt.NDArray[np.int32]:
    """Residuals of the temporal basis, of shape (K, C, T), without modes that are all 0."""
    least = choices.least_rms * step * float(np.sqrt(frames.n_verts))
    strengths, vectors = frames.trajectories(least)
    strengths, vectors = strengths[: choices.n_modes], vectors[:, : choices.n_modes]
    scaled = vectors * (strengths / (choices.basis_step * step))
    shape = (-1, frames.n_columns, frames.n_frames)
    coded = encode_times(scaled.T.reshape(shape), choices.price)
    does_something = np.asarray(coded.any(axis=(1, 2)))
    does_something[0] = True
    return coded[does_something]


@staged("fields")
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
        The fields to come near to, in coding order and in steps.
    prepared : Prepared or None
        Weights to begin with, where they are known and there is no key.
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
    """The first level whose noise is shaped: of the finest resolutions, but never level 0."""
    resolution_of = mesh.hierarchy.level_resolutions
    first = resolution_of[-1] + 1 - choices.n_shaped_resolutions
    return max(1, int(np.searchsorted(resolution_of, first)))
