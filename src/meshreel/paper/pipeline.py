"""The paper's method: analysis of frames to integers and synthesis from them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.codec.paper_options import FINE_BITS, Allocation, PaperOptions
from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.codec.subspace.trajectories import BoundingFrame, to_matrices
from meshreel.paper.basis import (
    advance_basis,
    align_basis,
    expand,
    modes_for_energy,
    project,
    ritz_vectors,
)
from meshreel.paper.decoded_block import FramesOf
from meshreel.paper.laplacian import delta_coordinates
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.quantization import (
    Steps,
    dequantize,
    quantize,
    step_for_all_rows,
    steps_for_each_row,
)
from meshreel.paper.settings import allocation_of, anchor_bits, bits_of, choices, energy_share
from meshreel.paper.variants import Basis, Decoding, Signal, Variant, variant_named

DEFAULT_FREQUENCIES = 0.05
"""Fraction of the graph frequencies that `gft` keeps by default."""

MAX_RESPONSES = 1 << 26
"""Largest size of the matrix of responses of all vertices to all anchors."""

PREDICTION_STEP_RATIO = 8
"""Quantization step of coefficients that predict anchor positions, in steps of the positions."""


@dataclass(frozen=True)
class Quantized:
    """Integers of shape (3, rows, columns), and their quantization steps."""

    integers: Integers
    """int64 array of shape (3, rows, columns)."""
    steps: Steps
    """float32 array of shape (1,) or (rows,)."""

    @classmethod
    def of(cls, values: Floats, steps: Steps) -> "Quantized":
        """Quantize values with these steps."""
        return cls(quantize(values, steps), steps)

    @property
    def values(self) -> Floats:
        """The dequantized values."""
        return dequantize(self.integers, self.steps)


@dataclass(frozen=True)
class Anchors:
    """Anchors of a block: coefficients on its modes, and residuals of their positions.

    Positions are the product of basis and coefficients plus the residuals. One of the two may be
    missing: without residuals only motion within the span of the modes is coded; on graph
    frequencies (`gft`) the positions are not predicted.
    """

    coefficients: Quantized | None
    """Quantized of shape (3, K, A), or None."""
    residuals: Quantized | None
    """Quantized of shape (3, A, T), or None."""


@dataclass(frozen=True, eq=False)
class BlockValues:
    """Dequantized values of a block of frames."""

    basis: Floats | None
    """float64 array of shape (3, T, K), or None. Eigen-trajectories of each axis as columns. None
    on graph frequencies (`gft`).
    """
    coefficients: Floats
    """float64 array of shape (3, K, V), or (3, K, T) on graph frequencies. Possibly fewer rows than
    the basis has columns (`truncated`).
    """
    anchor_coefficients: Floats | None
    """float64 array of shape (3, K, A), or None. Coefficients of the anchors on the leading modes.
    """
    anchor_residuals: Floats | None
    """float64 array of shape (3, A, T), or None. Anchor positions less their prediction from the
    coefficients.
    """

    @property
    def n_modes(self) -> int:
        """Number of modes of each axis, or of graph frequencies, K."""
        return int(self.coefficients.shape[1])

    @property
    def anchor_positions(self) -> Floats | None:
        """Decoded positions of the anchors (Eq. 12), of shape (3, T, A); None without anchors."""
        predicted: Floats | float = 0.0
        if self.anchor_coefficients is not None:
            assert self.basis is not None  # the coefficients refer to its modes
            n_modes = self.anchor_coefficients.shape[1]
            predicted = expand(self.basis[:, :, :n_modes], self.anchor_coefficients)
        elif self.anchor_residuals is None:
            return None
        if self.anchor_residuals is None:
            return np.asarray(predicted)
        return np.asarray(predicted + np.swapaxes(self.anchor_residuals, 1, 2))

    def truncated(self, n_modes: int) -> "BlockValues":
        """The block with the first rows of coefficients only (the paper's k_l).

        Anchors with coded positions keep all of their motion; others keep the coefficients of the
        same modes.
        """
        anchors = self.anchor_coefficients
        if anchors is not None and self.anchor_residuals is None:
            anchors = anchors[:, :n_modes]
        return replace(
            self, coefficients=self.coefficients[:, :n_modes], anchor_coefficients=anchors
        )


@dataclass(frozen=True)
class CodedBlock:
    """Integers of a block of frames: its stored data except isolated vertices.

    On eigen-trajectories a row belongs to a mode. On graph frequencies (`gft`) a row of
    coefficients is a frequency over time.
    """

    basis: Quantized | None
    """Quantized of shape (3, K, T), or None. The dictionary: a row for each eigen-trajectory of
    each axis. None on graph frequencies.
    """
    anchors: Anchors | None
    coefficients: Quantized
    """Quantized of shape (3, K, V), or (3, K, T) on graph frequencies."""

    @property
    def n_modes(self) -> int:
        """Modes of each axis, or graph frequencies, K."""
        return int(self.coefficients.integers.shape[1])

    @property
    def values(self) -> BlockValues:
        """The dequantized values."""
        coefficients = residuals = None
        if self.anchors is not None and self.anchors.coefficients is not None:
            coefficients = self.anchors.coefficients.values
        if self.anchors is not None and self.anchors.residuals is not None:
            residuals = self.anchors.residuals.values
        basis = None if self.basis is None else _columns(self.basis)
        return BlockValues(basis, self.coefficients.values, coefficients, residuals)


def analyse(
    vertices: npt.NDArray[np.floating],
    frame: BoundingFrame,
    mesh: MeshModel,
    config: PaperOptions,
    reference: Quantized | None = None,
) -> CodedBlock:
    """Transform and quantize a block of frames.

    Parameters
    ----------
    vertices : float array of shape (T, V, 3)
        Positions in internal vertex order.
    frame : BoundingFrame
        Units of the coordinate matrices A (`subspace.trajectories`).
    reference : Quantized, optional
        Dictionary of the previous block, from which a tracked one starts.
    """
    method, matrices = variant_named(config.method), to_matrices(vertices, frame)
    if method.basis is Basis.GRAPH:
        return _analyse_on_graph(matrices, mesh, config)
    basis = _dictionary(matrices, frame, config, reference)
    # Project on the quantized dictionary, which the decoder uses.
    projected = project(_columns(basis), matrices)
    anchors = None
    if method.has_anchors:
        at_anchors = projected[:, :, mesh.anchors], matrices[:, :, mesh.anchors]
        anchors = _code_anchors(*at_anchors, basis, config)
    if choices(config).quantize == "deltas":
        # The other reading of variant (ii): quantize deltas, project them, round finely.
        deltas = _deltas(matrices, mesh)
        rounded = Quantized.of(deltas, _coefficient_steps(deltas, config))
        signal = project(_columns(basis), rounded.values)
        coefficients = _quantize(signal, FINE_BITS)
    else:
        signal = _deltas(projected, mesh) if method.signal is Signal.DELTAS else projected
        coefficients = Quantized.of(signal, _coefficient_steps(signal, config))
    return CodedBlock(basis, anchors, coefficients)


def synthesise(block: BlockValues, mesh: MeshModel, method: Variant, order: Integers) -> FramesOf:
    """Return a function that computes frames of a block, vertices in output order.

    On eigen-trajectories the system is solved for the K columns of each axis, not for each frame:
    the Laplacian acts on vertices and the basis on frames, so the two commute. The solution is
    also linear in the anchors: the contribution of their residuals is a sum of responses to each
    anchor, solved once, or is solved for the requested frames, depending on the number of columns
    and on memory. The serial variants of the paper solve for each frame nevertheless.

    Parameters
    ----------
    order : integer array of shape (V,)
        Internal number of each output vertex.
    """
    if method.is_serial:
        deltas_of, anchors_of = _signals_of_frames(block, mesh)
        return _frame_by_frame(mesh, deltas_of, anchors_of, order)
    assert block.basis is not None  # only serial variants have none
    basis, fields = block.basis, block.coefficients
    if method.has_anchors:
        values = block.anchor_coefficients
        assert values is not None  # always present on eigen-trajectories
        # Anchors keep the modes that a truncated block drops.
        fields = np.pad(fields, ((0, 0), (0, values.shape[1] - fields.shape[1]), (0, 0)))
        fields = _solve(mesh, fields, values)
    basis, fields = basis[:, :, : fields.shape[1]], np.ascontiguousarray(fields[:, :, order])
    if block.anchor_residuals is None:
        return lambda frames: expand(basis[:, frames], fields)
    residual_frames = _residual_frames(mesh, block.anchor_residuals, order)
    return lambda frames: expand(basis[:, frames], fields) + residual_frames(frames)


def modes_needed(
    vertices: npt.NDArray[np.floating], frame: BoundingFrame, config: PaperOptions
) -> int:
    """Smallest number of modes that keeps the configured fraction of the energy of a block."""
    matrices = to_matrices(vertices, frame)
    return _modes_needed(_correlation(matrices, frame, config), matrices, config)


def n_frequencies(n_modes: int | None, n_verts: int) -> int:
    """Number of graph frequencies of `gft`; by default a fraction of the vertices."""
    return n_modes or int(np.ceil(DEFAULT_FREQUENCIES * n_verts))


def _correlation(matrices: Floats, frame: BoundingFrame, config: PaperOptions) -> Floats:
    """R of shape (3, T, T), of positions relative to the center of the box or as given."""
    # Deviation from Eq. 7: centered by default, so that a large offset costs no precision.
    if choices(config).centering == "none":
        matrices = matrices + (np.array(frame.origin) / frame.scale)[:, None, None]
    return autocorrelation(matrices)


def _dictionary(
    matrices: Floats, frame: BoundingFrame, config: PaperOptions, reference: Quantized | None
) -> Quantized:
    """Eigen-trajectories as integers of shape (3, K, T)."""
    correlation = _correlation(matrices, frame, config)
    if reference is not None:
        start = _columns(reference)
        basis = advance_basis(correlation, start, config.n_iterations)
        if choices(config).rotation == "ritz":
            basis = ritz_vectors(correlation, basis)
        return Quantized.of(np.swapaxes(align_basis(basis, start), 1, 2), reference.steps)
    n_modes = config.n_modes or _modes_needed(correlation, matrices, config)
    _, basis = eigen_trajectories(correlation, min(n_modes, matrices.shape[1]))
    return _quantize(np.swapaxes(basis, 1, 2), choices(config).dictionary_bits)


def _modes_needed(correlation: Floats, matrices: Floats, config: PaperOptions) -> int:
    eigenvalues, _ = eigen_trajectories(correlation, matrices.shape[1])
    total = float(np.trace(correlation, axis1=1, axis2=2).sum())
    centered = matrices - matrices.mean(axis=2, keepdims=True)
    shape_energy = float(np.vdot(centered, centered))
    return modes_for_energy(eigenvalues, total, shape_energy, energy_share(config))


def _deltas(rows: Floats, mesh: MeshModel) -> Floats:
    """Delta coordinates of every row of shape (V,), of an array of shape (3, rows, V)."""
    return np.stack([delta_coordinates(mesh.laplacian, axis.T).T for axis in rows])


def _code_anchors(
    coefficients: Floats, positions: Floats, basis: Quantized, config: PaperOptions
) -> Anchors:
    """The anchors of a block on eigen-trajectories.

    Parameters
    ----------
    coefficients : float64 array of shape (3, K, A)
    positions : float64 array of shape (3, T, A)
    basis : Quantized of shape (3, K, T)
    """
    is_exact = variant_named(config.method).decoding is Decoding.ANCHORED
    if not is_exact or choices(config).anchor_values == "coefficients":
        # Deviation from Eq. 12, optional: motion outside the span of the modes is not coded, and
        # least squares spreads the error over the mesh. Without anchors (Eq. 11) the one vertex
        # of each component only translates it; its residual would move the whole component.
        return Anchors(_quantize(coefficients, anchor_bits(config)), None)
    steps = step_for_all_rows(positions, anchor_bits(config))
    coded = Quantized.of(coefficients, steps * np.float32(PREDICTION_STEP_RATIO))
    residuals = positions - expand(_columns(basis), coded.values)
    return Anchors(coded, Quantized.of(np.swapaxes(residuals, 1, 2), steps))


def _residual_frames(mesh: MeshModel, values: Floats, order: Integers) -> FramesOf:
    """Return a function that computes the contribution of anchor residuals of shape (3, A, T)."""
    n_anchors, n_frames = values.shape[1:]
    has_few_anchors = n_anchors <= 3 * max(n_frames, mesh.n_frames)
    if has_few_anchors and n_anchors * mesh.n_verts <= MAX_RESPONSES:
        responses = mesh.anchor_responses[order].T
        return lambda frames: np.swapaxes(values[:, :, frames], 1, 2) @ responses

    def solve_frames(frames: slice) -> Floats:
        anchors = np.swapaxes(values[:, :, frames], 1, 2)
        zeros = np.zeros((*anchors.shape[:2], mesh.n_verts))
        return _solve(mesh, zeros, anchors)[:, :, order]

    return solve_frames


def _columns(basis: Quantized) -> Floats:
    """The basis vectors of a dictionary as columns, of shape (3, T, K)."""
    return np.swapaxes(basis.values, 1, 2)


def _quantize(values: Floats, bits: int) -> Quantized:
    return Quantized.of(values, step_for_all_rows(values, bits))


def _coefficient_steps(values: Floats, config: PaperOptions) -> Steps:
    bits = bits_of(config)
    if isinstance(bits, Sequence) or allocation_of(config) is Allocation.CONSTANT:
        return steps_for_each_row(values, bits)
    return step_for_all_rows(values, bits)


def _solve(mesh: MeshModel, deltas: Floats, anchors: Floats) -> Floats:
    """Fields of shape (3, K, V) that solve Eq. 12, for all columns at once."""
    n_modes, n_verts = deltas.shape[1:]
    columns = mesh.reconstruct(
        deltas.reshape(3 * n_modes, n_verts).T,
        anchors.reshape(3 * n_modes, len(mesh.anchors)).T,
    )
    return columns.T.reshape(3, n_modes, n_verts)


def _analyse_on_graph(matrices: Floats, mesh: MeshModel, config: PaperOptions) -> CodedBlock:
    """A block whose deltas are projected on low graph frequencies (the paper's "per mesh")."""
    frequencies = mesh.graph_fourier_basis(n_frequencies(config.n_modes, mesh.n_verts))
    spectra = np.swapaxes(_deltas(matrices, mesh) @ frequencies, 1, 2)
    positions = np.swapaxes(matrices[:, :, mesh.anchors], 1, 2)
    return CodedBlock(
        basis=None,
        anchors=Anchors(None, _quantize(positions, anchor_bits(config))),
        coefficients=Quantized.of(spectra, _coefficient_steps(spectra, config)),
    )


def _signals_of_frames(block: BlockValues, mesh: MeshModel) -> tuple[FramesOf, FramesOf]:
    """Functions from frames to deltas of shape (3, frames, V) and anchors of (3, frames, A)."""
    anchors = block.anchor_positions
    assert anchors is not None  # serial variants solve a system
    coefficients = block.coefficients
    if block.basis is None:
        frequencies = mesh.graph_fourier_basis(block.n_modes)
        return (
            lambda frames: np.swapaxes(coefficients[:, :, frames], 1, 2) @ frequencies.T,
            lambda frames: anchors[:, frames],
        )
    basis = block.basis[:, :, : block.n_modes]
    return lambda frames: expand(basis[:, frames], coefficients), lambda frames: anchors[:, frames]


def _frame_by_frame(
    mesh: MeshModel, deltas_of: FramesOf, anchors_of: FramesOf, order: Integers
) -> FramesOf:
    """Return a function that factors and solves Eq. 12 for each frame."""

    def frames_of(frames: slice) -> Floats:
        deltas, anchors = deltas_of(frames), anchors_of(frames)
        solutions = [
            mesh.reconstruct_uncached(deltas[:, frame].T, anchors[:, frame].T).T
            for frame in range(deltas.shape[1])
        ]
        return np.stack(solutions, axis=1)[:, :, order]

    return frames_of
