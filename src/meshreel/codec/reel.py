"""The method `reel`: mode fields in groups, each with a Laplacian learned from those before.

A mode is one field on the mesh with a time vector for each axis. Fields are coded in groups; the
deltas of a group are taken with weights that reproduce the fields decoded before, and its anchors
are coded in stages in closed loop: what is sent at a stage is the difference to what the stages
before predict. Encoder and decoder run the same `reconstruct_fields`; they differ only in where
the integers come from.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.codec.mesh_model import MeshModel
from meshreel.geometry.anchors import nested_anchors
from meshreel.geometry.connectivity import adjacency_matrix, component_labels
from meshreel.geometry.laplacian import (
    delta_coordinates,
    reproducing_laplacian,
)
from meshreel.reconstruction.system import ReconstructionSystem
from meshreel.subspace.pca import joint_trajectories

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

GROUP_ENDS = (2, 4, 8)
SPACINGS = (11, 6, 3)
LEAST_ANCHORS = 4
BASIS_STEP = 3.0
"""Step of the basis by that of the coefficients, both as they act on positions."""

DEAD_ZONE = 0.6
"""Magnitudes below this share of a step become 0; half is plain rounding."""

LEAST_RMS = 0.6
"""A mode is kept if its field's root mean square exceeds this share of a step."""

RIDGE = 32.0 / 12.0
"""Strength of the ridge of reproducing weights, in squared steps: 32 x the variance of rounding."""


@dataclass(frozen=True)
class Layout:
    """How a block's fields are cut into groups and its anchors into stages.

    Attributes
    ----------
    step : float32
        Of deltas and anchors.
    group_ends : tuple of int
        Number of the mode behind each group; ascending, the last is K.
    spacings : tuple of int
        Of the anchors of each stage, in edges.
    least_anchors : int
        Of each component in the first stage.
    """

    step: np.float32
    group_ends: tuple[int, ...]
    spacings: tuple[int, ...] = SPACINGS
    least_anchors: int = LEAST_ANCHORS


@dataclass(frozen=True)
class FieldBlock:
    """A block of frames as integers.

    Attributes
    ----------
    layout : Layout
    basis : int64 array of shape (3, K, T)
        Time vectors; each is divided by its length.
    deltas : int64 array of shape (K, V)
    residuals : tuple of int64 arrays of shape (K, A_i)
        For each stage, what the anchors' values are beyond their prediction.
    """

    layout: Layout
    basis: Integers
    deltas: Integers
    residuals: tuple[Integers, ...]

    @property
    def n_modes(self) -> int:
        """K."""
        return int(self.deltas.shape[0])


@dataclass(frozen=True)
class FieldMesh:
    """What both sides derive from connectivity for a layout."""

    mesh: MeshModel
    layout: Layout

    @cached_property
    def adjacency(self) -> csr_array:
        """Binary, of shape (V, V)."""
        return adjacency_matrix(self.mesh.faces, self.mesh.n_verts)

    @property
    def neighbours(self) -> tuple[Integers, Integers]:
        """The adjacency as index arrays: starts of shape (V + 1,), and neighbours."""
        return self.adjacency.indptr.astype(np.int64), self.adjacency.indices.astype(np.int64)

    @cached_property
    def stages(self) -> list[Integers]:
        """Anchors of each stage, without isolated vertices."""
        _, labels = component_labels(self.mesh.faces, self.mesh.n_verts)
        sets = nested_anchors(
            self.adjacency, labels, self.layout.spacings, self.layout.least_anchors
        )
        return [np.setdiff1d(members, self.mesh.isolated) for members in sets]

    def laplacian(self, known: Floats) -> csr_array:
        """Laplacian for the group after the known fields, of shape (V, k)."""
        return reproducing_laplacian(self.adjacency, known, RIDGE * float(self.layout.step) ** 2)


DeltasOf = Callable[[slice, csr_array], Floats]
"""Gives decoded deltas of shape (V, k) of a group of modes, for its Laplacian."""

ResidualsOf = Callable[[slice, int, Floats], Integers]
"""Gives integers of shape (A_i, k) for a group, a stage and the prediction of the same shape."""


def reconstruct_fields(
    fields_mesh: FieldMesh, deltas_of: DeltasOf, residuals_of: ResidualsOf
) -> Floats:
    """Decoded fields of shape (V, K)."""
    n_verts, isolated = fields_mesh.mesh.n_verts, fields_mesh.mesh.isolated
    known = np.zeros((n_verts, 0))
    start = 0
    for end in fields_mesh.layout.group_ends:
        rows = slice(start, end)
        laplacian = fields_mesh.laplacian(known)
        deltas = deltas_of(rows, laplacian)
        solution, values = np.zeros((n_verts, end - start)), np.zeros((n_verts, end - start))
        anchors = isolated
        for stage, members in enumerate(fields_mesh.stages):
            if stage and not len(members):
                continue
            prediction = solution[members]
            residual = residuals_of(rows, stage, prediction)
            values[members] = prediction + float(fields_mesh.layout.step) * residual
            anchors = np.concatenate([anchors, members])
            solution = ReconstructionSystem(laplacian, anchors).solve(deltas, values[anchors])
        known = np.concatenate([known, solution], axis=1)
        start = end
    return known


def analyse_fields(
    matrices: Floats, mesh: MeshModel, position_step: float, n_modes: int | None
) -> FieldBlock:
    """A block of frames as integers.

    Parameters
    ----------
    matrices : float64 array of shape (3, T, V)
        Coordinate matrices, in internal vertex order.
    mesh : MeshModel
    position_step : float
        Step as it acts on a position, in diagonals; coefficients of T frames have sqrt(T) times
        this step.
    n_modes : int or None
        At most this many modes; None for all that the step does not make vanish.
    """
    n_frames = matrices.shape[1]
    step = np.float32(position_step * np.sqrt(n_frames))
    basis = _quantized_basis(matrices, float(step), n_modes)
    time_vectors = unit_time_vectors(basis)
    fields = _projected(time_vectors, matrices.reshape(3 * n_frames, -1))
    layout = Layout(step, group_ends(fields.shape[1], GROUP_ENDS))
    recorder = _Recorder(fields, float(step), FieldMesh(mesh, layout))
    reconstruct_fields(recorder.mesh, recorder.deltas_of, recorder.residuals_of)
    return FieldBlock(
        layout=layout,
        basis=basis,
        deltas=recorder.deltas,
        residuals=tuple(recorder.residuals),
    )


def synthesise_fields(block: FieldBlock, mesh: MeshModel) -> tuple[Floats, Floats]:
    """Basis of shape (3, T, K) and fields of shape (1, K, V): frames are their product."""
    step = float(block.layout.step)

    def deltas_of(rows: slice, laplacian: csr_array) -> Floats:
        return np.asarray(block.deltas[rows].T * step, np.float64)

    def residuals_of(rows: slice, stage: int, prediction: Floats) -> Integers:
        return block.residuals[stage][rows].T

    fields = reconstruct_fields(FieldMesh(mesh, block.layout), deltas_of, residuals_of)
    n_modes, n_frames = block.basis.shape[1:]
    vectors = unit_time_vectors(block.basis).reshape(3, n_frames, n_modes)
    return vectors, fields.T[None]


def unit_time_vectors(basis: Integers) -> Floats:
    """Time vectors of shape (3 T, K), each of length 1 (or 0), from integers of shape (3, K, T)."""
    columns = np.swapaxes(basis, 1, 2).reshape(-1, basis.shape[1]).astype(np.float64)
    lengths = np.linalg.norm(columns, axis=0)
    return np.asarray(columns / np.where(lengths > 0, lengths, 1.0))


def group_ends(n_modes: int, ends: Sequence[int]) -> tuple[int, ...]:
    """Ends of the groups of K modes, for the ends of all groups but the last."""
    return (*(end for end in ends if end < n_modes), n_modes)


def _projected(time_vectors: Floats, stacked: Floats) -> Floats:
    """Fields of shape (V, K) whose product with the time vectors is nearest to the frames."""
    gram = time_vectors.T @ time_vectors  # rounding leaves the vectors not quite orthonormal
    inverse = np.linalg.pinv(gram, hermitian=True)
    return np.asarray(stacked.T @ (time_vectors @ inverse), np.float64)


def _quantized_basis(matrices: Floats, step: float, n_modes: int | None) -> Integers:
    """Time vectors as integers of shape (3, K, T), without modes that the steps make vanish."""
    n_frames, n_verts = matrices.shape[1:]
    limit = min(3 * n_frames, n_verts) if n_modes is None else n_modes
    strengths, vectors = joint_trajectories(matrices, limit)
    is_kept = strengths > LEAST_RMS * step * np.sqrt(n_verts)
    n_kept = max(1, int(is_kept.sum()))
    integers = np.rint(vectors * (strengths / (BASIS_STEP * step)))[:, :n_kept].astype(np.int64)
    does_something = np.abs(integers).sum(axis=0) > 0
    does_something[0] = True
    kept = integers[:, does_something].reshape(3, n_frames, -1)
    return np.ascontiguousarray(np.swapaxes(kept, 1, 2))


@dataclass
class _Recorder:
    """The encoder's side of `reconstruct_fields`: quantises what it is asked for, and keeps it."""

    fields: Floats
    step: float
    mesh: FieldMesh

    def __post_init__(self) -> None:
        n_verts, n_modes = self.fields.shape
        self.deltas = np.zeros((n_modes, n_verts), np.int64)
        self.residuals = [
            np.zeros((n_modes, len(members)), np.int64) for members in self.mesh.stages
        ]

    def deltas_of(self, rows: slice, laplacian: csr_array) -> Floats:
        """Decoded deltas of a group."""
        scaled = delta_coordinates(laplacian, self.fields[:, rows]) / self.step
        integers = np.sign(scaled) * np.floor(np.abs(scaled) + 1.0 - DEAD_ZONE)
        self.deltas[rows] = integers.astype(np.int64).T
        return np.asarray(integers * self.step, np.float64)

    def residuals_of(self, rows: slice, stage: int, prediction: Floats) -> Integers:
        """What is sent of the anchors of a stage."""
        wanted = self.fields[self.mesh.stages[stage], rows]
        residual = np.rint((wanted - prediction) / self.step).astype(np.int64)
        self.residuals[stage][rows] = residual.T
        return residual
