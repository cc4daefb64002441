"""The paper's method: analysis of frames to integers and synthesis from them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.config import EncoderConfig
from meshreel.codec.frame_products import FramesOf, product_frames
from meshreel.geometry.laplacian import delta_coordinates
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.options import DEFAULT_FREQUENCIES
from meshreel.paper.quantization import (
    Steps,
    dequantize,
    quantize,
    step_for_all_rows,
    steps_for_each_row,
)
from meshreel.paper.settings import allocation_of, bits_of, energy_share
from meshreel.paper.subspace.orthogonal_iteration import advance_basis, align_basis, ritz_vectors
from meshreel.paper.subspace.rank import modes_for_energy
from meshreel.paper.variants import Allocation, Basis, Signal, Variant, variant_named
from meshreel.runtime.profiling import staged
from meshreel.subspace.basis import expand, project
from meshreel.subspace.pca import autocorrelation, eigen_trajectories

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


BASIS_BITS = 16
ANCHOR_BITS = 16


@dataclass(frozen=True)
class Quantized:
    """Integers of shape (3, rows, columns), and their quantisation steps.

    Attributes
    ----------
    integers : int64 array of shape (3, rows, columns)
    steps : float32 array of shape (1,) or (rows,)
    """

    integers: Integers
    steps: Steps

    @classmethod
    def of(cls, values: Floats, steps: Steps) -> "Quantized":
        """The values, quantised with these steps."""
        return cls(quantize(values, steps), steps)

    @property
    def values(self) -> Floats:
        """The dequantised values, as the decoder has them."""
        return dequantize(self.integers, self.steps)


@dataclass(frozen=True)
class CodedBlock:
    """A block of frames as integers: everything stored of it except isolated vertices.

    On eigen-trajectories a row belongs to a mode. On graph frequencies (`gft`) a row of
    coefficients is a frequency over time, and a row of anchors is an anchor over time.

    Attributes
    ----------
    basis : Quantized of shape (3, K, T), or None
        The dictionary: a row for each eigen-trajectory of each axis. None on graph frequencies.
    anchors : Quantized of shape (3, K, A), or (3, A, T) on graph frequencies, or None
        Coefficients of the anchors' trajectories, or positions of the anchors.
    coefficients : Quantized of shape (3, K, V), or (3, K, T) on graph frequencies
    """

    basis: Quantized | None
    anchors: Quantized | None
    coefficients: Quantized

    @property
    def n_modes(self) -> int:
        """Modes of each axis, or graph frequencies, K."""
        return int(self.coefficients.integers.shape[1])


@staged("analysis")
def analyse(
    matrices: Floats, mesh: MeshModel, config: EncoderConfig, before: Quantized | None = None
) -> CodedBlock:
    """A block of frames as integers.

    Parameters
    ----------
    matrices : float64 array of shape (3, T, V)
        Coordinate matrices A, in internal vertex order (`subspace.trajectories`).
    mesh : MeshModel
    config : EncoderConfig
    before : Quantized, optional
        Dictionary of the block before, from which a tracked one starts.
    """
    method = variant_named(config.method)
    if method.basis is Basis.GRAPH:
        return _analyse_on_graph(matrices, mesh, config)
    basis = _dictionary(matrices, config, before)
    # Onto the dictionary as the decoder has it, quantised.
    projected = project(np.swapaxes(basis.values, 1, 2), matrices)
    signal = _deltas(projected, mesh) if method.signal is Signal.DELTAS else projected
    return CodedBlock(
        basis=basis,
        # Deviation from Eq. 12: the anchors' K coefficients are sent, not their T positions:
        # components outside the span of the K modes have no effect on the solution.
        anchors=_fine(projected[:, :, mesh.anchors], ANCHOR_BITS) if method.has_anchors else None,
        coefficients=Quantized.of(signal, _coefficient_steps(signal, config)),
    )


def synthesise(block: CodedBlock, mesh: MeshModel, method: Variant, order: Integers) -> FramesOf:
    """A function that returns frames of a block, vertices in output order.

    On eigen-trajectories the system is solved once for the K columns of each axis, not for each
    frame: the Laplacian acts on vertices and the basis on frames, so that the two commute. The
    serial variants of the paper solve for each frame nevertheless.

    Parameters
    ----------
    block : CodedBlock
    mesh : MeshModel
    method : Variant
    order : integer array of shape (V,)
        Internal number of each output vertex.
    """
    if method.is_serial:
        deltas_of, anchors_of = _signals_of_frames(block, mesh)
        return _frame_by_frame(mesh, deltas_of, anchors_of, order)
    assert block.basis is not None  # only serial variants have none
    basis = np.swapaxes(block.basis.values, 1, 2)
    coefficients = block.coefficients.values
    if block.anchors is not None:
        coefficients = _solved(mesh, coefficients, block.anchors.values)
    return product_frames(basis, coefficients[:, :, order])


def modes_needed(matrices: Floats, config: EncoderConfig) -> int:
    """Smallest number of modes that keeps the configured share of the energy of a block."""
    return _modes_needed(autocorrelation(matrices), matrices, config)


def _dictionary(matrices: Floats, config: EncoderConfig, before: Quantized | None) -> Quantized:
    """Eigen-trajectories as integers of shape (3, K, T)."""
    correlation = autocorrelation(matrices)
    if before is not None:
        start = np.swapaxes(before.values, 1, 2)
        tracked = ritz_vectors(correlation, advance_basis(correlation, start, config.n_iterations))
        return Quantized.of(np.swapaxes(align_basis(tracked, start), 1, 2), before.steps)
    n_modes = config.n_modes or _modes_needed(correlation, matrices, config)
    _, basis = eigen_trajectories(correlation, min(n_modes, matrices.shape[1]))
    return _fine(np.swapaxes(basis, 1, 2), BASIS_BITS)


def _modes_needed(correlation: Floats, matrices: Floats, config: EncoderConfig) -> int:
    eigenvalues, _ = eigen_trajectories(correlation, matrices.shape[1])
    total = float(np.trace(correlation, axis1=1, axis2=2).sum())
    centred = matrices - matrices.mean(axis=2, keepdims=True)
    shape_energy = float(np.vdot(centred, centred))
    return modes_for_energy(eigenvalues, total, shape_energy, energy_share(config))


def _deltas(rows: Floats, mesh: MeshModel) -> Floats:
    """Delta coordinates of every row of shape (V,), of an array of shape (3, rows, V)."""
    return np.stack([delta_coordinates(mesh.laplacian, axis.T).T for axis in rows])


def _fine(values: Floats, bits: int) -> Quantized:
    return Quantized.of(values, step_for_all_rows(values, bits))


def _coefficient_steps(values: Floats, config: EncoderConfig) -> Steps:
    bits = bits_of(config)
    if isinstance(bits, Sequence) or allocation_of(config) is Allocation.CONSTANT:
        return steps_for_each_row(values, bits)
    return step_for_all_rows(values, bits)


def _solved(mesh: MeshModel, deltas: Floats, anchors: Floats) -> Floats:
    """Coefficients of the vertices, of shape (3, K, V): Eq. 12 for all columns at once."""
    n_modes, n_verts = deltas.shape[1:]
    columns = mesh.reconstruct(
        deltas.reshape(3 * n_modes, n_verts).T,
        anchors.reshape(3 * n_modes, len(mesh.anchors)).T,
    )
    return columns.T.reshape(3, n_modes, n_verts)


def _analyse_on_graph(matrices: Floats, mesh: MeshModel, config: EncoderConfig) -> CodedBlock:
    """A block whose deltas are projected on low graph frequencies (the paper's "per mesh")."""
    n_modes = config.n_modes or int(np.ceil(DEFAULT_FREQUENCIES * mesh.n_verts))
    frequencies = mesh.graph_fourier_basis(min(n_modes, mesh.n_verts))
    spectra = np.swapaxes(_deltas(matrices, mesh) @ frequencies, 1, 2)
    positions = np.swapaxes(matrices[:, :, mesh.anchors], 1, 2)
    return CodedBlock(
        basis=None,
        anchors=_fine(positions, ANCHOR_BITS),
        coefficients=Quantized.of(spectra, _coefficient_steps(spectra, config)),
    )


def _signals_of_frames(block: CodedBlock, mesh: MeshModel) -> tuple[FramesOf, FramesOf]:
    """Functions from frames to deltas of shape (3, frames, V) and anchors of (3, frames, A)."""
    assert block.anchors is not None  # serial variants solve a system
    coefficients, anchors = block.coefficients.values, block.anchors.values
    if block.basis is None:
        frequencies = mesh.graph_fourier_basis(block.n_modes)
        return (
            lambda frames: np.swapaxes(coefficients[:, :, frames], 1, 2) @ frequencies.T,
            lambda frames: np.swapaxes(anchors[:, :, frames], 1, 2),
        )
    basis = np.swapaxes(block.basis.values, 1, 2)
    return (
        lambda frames: expand(basis[:, frames], coefficients),
        lambda frames: expand(basis[:, frames], anchors),
    )


def _frame_by_frame(
    mesh: MeshModel, deltas_of: FramesOf, anchors_of: FramesOf, order: Integers
) -> FramesOf:
    """A function that solves Eq. 12 frame by frame, with the system factored for each."""

    def frames_of(frames: slice) -> Floats:
        deltas, anchors = deltas_of(frames), anchors_of(frames)
        solved = [
            mesh.reconstruct_uncached(deltas[:, frame].T, anchors[:, frame].T).T
            for frame in range(deltas.shape[1])
        ]
        return np.stack(solved, axis=1)[:, :, order]

    return frames_of
