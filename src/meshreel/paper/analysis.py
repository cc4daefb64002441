"""Encoder side of the paper's method: from frames to the integers of a block."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from meshreel.arrays import Floats
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
from meshreel.paper.coded_values import Anchors, CodedBlock, Quantized, basis_columns
from meshreel.paper.laplacian import delta_coordinates
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.quantization import Steps, step_for_all_rows, steps_for_each_row
from meshreel.paper.settings import allocation_of, anchor_bits, bits_of, choices, energy_share
from meshreel.paper.variants import Basis, Decoding, Signal, variant_named

DEFAULT_FREQUENCIES = 0.05
"""Fraction of the graph frequencies that `gft` keeps by default."""

PREDICTION_STEP_RATIO = 8
"""Quantization step of coefficients that predict anchor positions, in steps of the positions."""


@dataclass(frozen=True)
class Replacements:
    """Steps of the method that an experiment replaces; arrays are in internal vertex order."""

    laplacian: csr_array | None = None
    """csr_array of shape (V, V), or None."""
    basis: Callable[[Floats, Floats | None], Floats] | None = None
    """Maps coordinate matrices of shape (3, T, V) and the decoded basis of the previous block, or
    None, to a basis of shape (3, T, K).
    """
    predictor: Callable[[Floats, Floats | None], Floats] | None = None
    """Maps the decoded basis and anchor positions of a block to predicted coefficients of shape
    (3, K, V).
    """


THE_PAPERS = Replacements()


def analyse(
    vertices: npt.NDArray[np.floating],
    frame: BoundingFrame,
    mesh: MeshModel,
    config: PaperOptions,
    reference: Quantized | None = None,
    replacements: Replacements = THE_PAPERS,
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
    replacements : Replacements, optional
        Not for graph frequencies, except the Laplacian.
    """
    method, matrices = variant_named(config.method), to_matrices(vertices, frame)
    if method.basis is Basis.GRAPH:
        return _analyse_on_graph(matrices, mesh, config)
    if replacements.basis is not None:
        basis = _own_dictionary(matrices, replacements.basis, config, reference)
    else:
        basis = _dictionary(matrices, frame, config, reference)
    # Project on the quantized dictionary, which the decoder uses.
    projected = project(basis_columns(basis), matrices)
    anchors = None
    if method.has_anchors:
        at_anchors = projected[:, :, mesh.anchors], matrices[:, :, mesh.anchors]
        anchors = _code_anchors(*at_anchors, basis, config)
    if choices(config).quantize == "deltas":
        # The other reading of variant (ii): quantize deltas, project them, round finely.
        deltas = _deltas(matrices, mesh)
        rounded = Quantized.of(deltas, _coefficient_steps(deltas, config))
        signal = project(basis_columns(basis), rounded.values)
        steps = step_for_all_rows(signal, FINE_BITS)
    else:
        signal = _deltas(projected, mesh) if method.signal is Signal.DELTAS else projected
        steps = _coefficient_steps(signal, config)
    block = CodedBlock(basis, anchors, Quantized.of(signal, steps))
    if replacements.predictor is None:
        return block
    prediction = replacements.predictor(basis_columns(basis), block.values.anchor_positions)
    residual = Quantized.of(signal - prediction, steps)
    return replace(block, coefficients=residual, prediction=prediction)


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
        start = basis_columns(reference)
        basis = advance_basis(correlation, start, config.n_iterations)
        if choices(config).rotation == "ritz":
            basis = ritz_vectors(correlation, basis)
        return _like(reference, align_basis(basis, start), config)
    n_modes = config.n_modes or _modes_needed(correlation, matrices, config)
    _, basis = eigen_trajectories(correlation, min(n_modes, matrices.shape[1]))
    return _quantize(np.swapaxes(basis, 1, 2), choices(config).dictionary_bits)


def _own_dictionary(
    matrices: Floats,
    basis_of: Callable[[Floats, Floats | None], Floats],
    config: PaperOptions,
    reference: Quantized | None,
) -> Quantized:
    """The dictionary of an experiment; of equal shape, it is aligned with the previous one."""
    start = None if reference is None else basis_columns(reference)
    basis = basis_of(matrices, start)
    if reference is None or start is None or basis.shape != start.shape:
        return _quantize(np.swapaxes(basis, 1, 2), choices(config).dictionary_bits)
    return _like(reference, align_basis(basis, start), config)


def _like(reference: Quantized, basis: Floats, config: PaperOptions) -> Quantized:
    """A dictionary with the steps of the previous one, unless it is stored whole."""
    rows = np.swapaxes(basis, 1, 2)
    if choices(config).dictionary == "whole":
        return _quantize(rows, choices(config).dictionary_bits)
    return Quantized.of(rows, reference.steps)


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
    residuals = positions - expand(basis_columns(basis), coded.values)
    return Anchors(coded, Quantized.of(np.swapaxes(residuals, 1, 2), steps))


def _quantize(values: Floats, bits: int) -> Quantized:
    return Quantized.of(values, step_for_all_rows(values, bits))


def _coefficient_steps(values: Floats, config: PaperOptions) -> Steps:
    bits = bits_of(config)
    if isinstance(bits, Sequence) or allocation_of(config) is Allocation.CONSTANT:
        return steps_for_each_row(values, bits)
    return step_for_all_rows(values, bits)


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
