"""Residuals of tracks relative to decoded positions, and the fit of velocities to differences."""

import numpy as np

from meshreel.arrays import Values, Vertices
from meshreel.codec.methods import UnreachableError
from meshreel.codec.reel.normative.expected import (
    MovingSurface,
    differences,
    expected_ranks,
    expected_values,
    ranks_of,
)
from meshreel.codec.source import CodedMesh
from meshreel.codec.tracks import DIFFERENCES, Coding, TrackHeader
from meshreel.errors import InvalidInputError
from meshreel.kernel.normals import find_rotations
from meshreel.runtime.threads import chunks, in_chunks

MAX_VALUES_PER_TASK = 1 << 18
"""Maximum number of values per task."""

MAX_RESIDUAL_SHARE = 0.5
"""Velocities with a larger share of squared residuals do not follow the positions."""

FPS_TOLERANCE, NEGLIGIBLE_SHARE = 1.1, 1e-8
"""The frame rate is used if its share of squared residuals is at most this many times the least,
or negligible."""


def moving_surface(mesh: CodedMesh) -> MovingSurface:
    """Return the surface of the decoded mesh."""
    summed = mesh.faces
    if mesh.keeps_vertex_order:
        summed = mesh.order[mesh.faces].astype(np.int32)
    return MovingSurface(summed, mesh.output_faces, mesh.surface)


INNER_FRAMES: dict[Coding, slice] = {
    Coding.BACKWARD: slice(1, None),
    Coding.CENTRAL: slice(1, -1),
    Coding.FORWARD: slice(None, -1),
}
"""Frames of a block whose differences need no frame outside the block."""


class DifferenceFit:
    """Fit of velocities by differences of positions over time, block by block."""

    def __init__(self) -> None:
        self._sums = {coding: np.zeros(3) for coding in DIFFERENCES}

    def add(self, velocities: Values, positions: Vertices) -> None:
        """Add the velocities and positions of a block, of shape (T_b, V, 3).

        Ignores NaN and infinite values.
        """
        n_frames, n_verts = velocities.shape[:2]
        for piece in chunks(n_verts, max(1, MAX_VALUES_PER_TASK // n_frames)):
            is_missing = ~np.isfinite(velocities[:, piece])
            known = np.where(is_missing, 0.0, velocities[:, piece])
            with np.errstate(over="ignore", invalid="ignore"):
                self._add(known, is_missing, positions[:, piece])

    def _add(self, known: Values, is_missing: Values, positions: Vertices) -> None:
        for coding, sums in self._sums.items():
            changes = differences(coding, positions)
            changes[is_missing] = 0.0
            velocities, changes = known[INNER_FRAMES[coding]], changes[INNER_FRAMES[coding]]
            sums += (
                np.vdot(velocities, velocities),
                np.vdot(velocities, changes),
                np.vdot(changes, changes),
            )

    def best(self, fps: float = 0.0) -> tuple[Coding, float] | None:
        """Return the best differences and their rate; None if no differences fit.

        The rate is the frame rate if that is known and fits as well.
        """
        shares = {
            coding: 1.0 - float(product / energy * (product / squares))
            for coding, (energy, product, squares) in self._sums.items()
            if energy > 0 and squares > 0 and np.isfinite([energy, product, squares]).all()
        }
        if not shares or not min(shares.values()) < MAX_RESIDUAL_SHARE:
            return None
        coding = min(shares, key=lambda candidate: shares[candidate])
        energy, product, squares = self._sums[coding]
        share = 1.0 - float(2.0 * fps * (product / energy) - fps**2 * (squares / energy))
        if share <= max(FPS_TOLERANCE * shares[coding], NEGLIGIBLE_SHARE):
            return coding, fps
        return coding, float(product / squares)


def residuals(
    header: TrackHeader, surface: MovingSurface, positions: Vertices, values: Values
) -> Values:
    """Return the residuals of a predicted track in a block.

    Parameters
    ----------
    positions : float array of shape (T_b, V, 3)
        Decoded positions in output order.
    values : float array of shape (T_b, N, 3)
        In output order. Residuals of missing values are missing.

    Returns
    -------
    float array of shape (T_b, N, C), of the type of the values

    Raises
    ------
    UnreachableError
        If no rotation maps a normal of the surface to that of the track.
    """
    result = np.empty((*values.shape[:2], header.n_coded), values.dtype)

    def fill(piece: slice) -> None:
        expected = expected_values(header, surface, positions, piece)
        if header.coding is not Coding.ROTATIONS:
            result[piece] = values[piece] - expected
            return
        is_missing = np.isnan(values[piece])
        if np.any(is_missing.any(axis=2) & ~is_missing.all(axis=2)):
            raise UnreachableError("some components of a normal are missing")
        normals = np.where(is_missing, expected, values[piece])
        try:
            result[piece] = find_rotations(expected, normals)
        except InvalidInputError as error:
            raise UnreachableError(*error.args) from error
        result[piece][is_missing.any(axis=2)] = np.nan

    in_chunks(fill, len(values), max(1, MAX_VALUES_PER_TASK // values.shape[1]))
    return result


def exact_residuals(
    header: TrackHeader, surface: MovingSurface, positions: Vertices, values: Values
) -> Values:
    """Return integer residuals of a lossless track; otherwise as `residuals`."""
    result = ranks_of(np.ascontiguousarray(values)).copy()

    def subtract(piece: slice) -> None:
        with np.errstate(over="ignore", invalid="ignore"):
            expected = expected_values(header, surface, positions, piece)
        result[piece] -= expected_ranks(header, expected)

    in_chunks(subtract, len(values), max(1, MAX_VALUES_PER_TASK // values.shape[1]))
    return result
