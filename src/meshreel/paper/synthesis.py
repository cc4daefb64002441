"""Decoder side of the paper's method: from the values of a block to frames."""

from collections.abc import Callable

import numpy as np

from meshreel.arrays import Floats, Integers
from meshreel.paper.basis import expand
from meshreel.paper.coded_values import BlockValues
from meshreel.paper.decoded_block import FramesOf
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.variants import Variant

MAX_RESPONSES = 1 << 26
"""Largest size of the matrix of responses of all vertices to all anchors."""


def synthesise(
    block: BlockValues,
    mesh: MeshModel,
    method: Variant,
    order: Integers,
    *,
    factor_once: bool = False,
) -> FramesOf:
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
    factor_once : bool
        Factor the system of serial variants once and not for each frame, with the same results.
    """
    if method.is_serial:
        deltas_of, anchors_of = _signals_of_frames(block, mesh)
        solve = mesh.reconstruct if factor_once else mesh.reconstruct_uncached
        return _frame_by_frame(solve, deltas_of, anchors_of, order)
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


def _solve(mesh: MeshModel, deltas: Floats, anchors: Floats) -> Floats:
    """Fields of shape (3, K, V) that solve Eq. 12, for all columns at once."""
    n_modes, n_verts = deltas.shape[1:]
    columns = mesh.reconstruct(
        deltas.reshape(3 * n_modes, n_verts).T,
        anchors.reshape(3 * n_modes, len(mesh.anchors)).T,
    )
    return columns.T.reshape(3, n_modes, n_verts)


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
    solve: Callable[[Floats, Floats], Floats],
    deltas_of: FramesOf,
    anchors_of: FramesOf,
    order: Integers,
) -> FramesOf:
    """Return a function that solves Eq. 12 for each frame."""

    def frames_of(frames: slice) -> Floats:
        deltas, anchors = deltas_of(frames), anchors_of(frames)
        solutions = [
            solve(deltas[:, frame].T, anchors[:, frame].T).T for frame in range(deltas.shape[1])
        ]
        return np.stack(solutions, axis=1)[:, :, order]

    return frames_of
