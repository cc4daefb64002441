"""Decoder side of the paper's method: from the values of a block to frames, on demand."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats, Integers, Vertices
from meshreel.codec.subspace.trajectories import BoundingFrame, from_matrices
from meshreel.paper.basis import expand
from meshreel.paper.coded_values import BlockValues
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.variants import Variant
from meshreel.runtime.threads import in_threads

MAX_RESPONSES = 1 << 26
"""Largest size of the matrix of responses of all vertices to all anchors."""

CHUNK_BYTES = 1 << 22
"""Size of the float64 frames computed at a time; they should fit into the cache."""

MAX_FRAMES_TOGETHER = 4

FramesOf = Callable[[slice], Floats]
"""Returns coordinate matrices of shape (3, frames, V) for a slice of the frames of a block."""


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


@dataclass(frozen=True)
class DecodedBlock:
    """A decoded block, whose frames are products of a basis and coefficients."""

    start: int
    n_frames: int
    """Number of the first frame, and number of frames."""
    frames_of: FramesOf
    """Coordinate matrices of a slice of the frames, in output order of vertices, without exact
    positions.
    """
    frame: BoundingFrame
    exact: Vertices | None = None
    """float array of shape (T_b, N, 3), or None. Positions of some vertices that replace the
    computed ones.
    """
    exact_vertices: Integers | None = None
    """Integer array of shape (N,), or None. These vertices, in output order."""

    def fill(self, out: Vertices, first: int) -> None:
        """Fill an array of shape (T, V, 3) with frames of this block, on all cores.

        Parameters
        ----------
        out : float array of shape (T, V, 3)
        first : int
            Number of the first of these frames within the block.
        """
        last = first + len(out)
        chunk_frames = max(1, min(MAX_FRAMES_TOGETHER, CHUNK_BYTES // (24 * out.shape[1])))

        # Products of matrices round by their shape: the same frames are always computed together.
        def fill(start: int) -> None:
            chunk = slice(start, min(start + chunk_frames, self.n_frames))
            requested = slice(max(start, first), min(chunk.stop, last))
            matrices = self.frames_of(chunk)[:, requested.start - start : requested.stop - start]
            out[requested.start - first : requested.stop - first] = from_matrices(
                matrices, self.frame, out.dtype
            )

        # Damaged values may overflow; the caller checks whether frames are finite.
        with np.errstate(over="ignore", invalid="ignore"):
            in_threads(fill, range(first // chunk_frames * chunk_frames, last, chunk_frames))
        if self.exact is not None:
            out[:, self.exact_vertices] = self.exact[first : first + len(out)]
