"""What decoded positions leave of a track: how it may follow from them, and what is to be coded."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.reel.normative.expected import (
    MovingSurface,
    differences,
    expected_places,
    expected_values,
    places_of,
)
from meshreel.codec.source import CodedMesh
from meshreel.codec.tracks import DIFFERENCES, Coding, TrackHeader
from meshreel.errors import InvalidInputError
from meshreel.kernel.normals import find_rotations
from meshreel.runtime.threads import chunks, in_threads

Values = npt.NDArray[Any]
Vertices = npt.NDArray[np.floating]

VALUES_AT_ONCE = 1 << 18
"""Values whose residuals are found at once."""

MOST_LEFT = 0.5
"""Velocities of which differences of positions leave more than this share of the sum of squares are
not those of the vertices."""

AS_WELL, LEAST_LEFT = 1.1, 1e-8
"""The frame rate fits as well as any other if what it leaves is at most so many times as much, or
so little in all."""


def moving_surface(mesh: CodedMesh) -> MovingSurface:
    """The surface of a mesh as it goes out."""
    summed = mesh.faces
    if mesh.keeps_vertex_order:
        summed = mesh.order[mesh.faces].astype(np.int32)
    return MovingSurface(summed, mesh.output_faces, mesh.surface)


class UnreachableError(InvalidInputError):
    """A normal cannot be reached from that of the surface; never seen outside this room."""


INSIDE = {
    Coding.BACKWARD: slice(1, None),
    Coding.CENTRAL: slice(1, -1),
    Coding.FORWARD: slice(None, -1),
}
"""Frames of a block whose differences are not those of its ends."""


class DifferenceFit:
    """How well velocities are differences of positions over time, block after block."""

    def __init__(self) -> None:
        self._sums = {coding: np.zeros(3) for coding in DIFFERENCES}

    def add(self, velocities: Values, positions: Vertices) -> None:
        """Take the velocities and positions of a block, of shape (T_b, V, 3).

        NaN and infinite values do not count.
        """
        n_frames, n_verts = velocities.shape[:2]
        for piece in chunks(n_verts, max(1, VALUES_AT_ONCE // n_frames)):
            given = velocities[:, piece]
            is_missing = ~np.isfinite(given)
            known = np.where(is_missing, 0.0, given)
            with np.errstate(over="ignore", invalid="ignore"):
                self._add(known, is_missing, positions[:, piece])

    def _add(self, known: Values, is_missing: Values, positions: Vertices) -> None:
        for coding, sums in self._sums.items():
            moved = differences(coding, positions)
            moved[is_missing] = 0.0
            one, other = known[INSIDE[coding]], moved[INSIDE[coding]]
            sums += np.vdot(one, one), np.vdot(one, other), np.vdot(other, other)

    def best(self, fps: float = 0.0) -> tuple[Coding, float] | None:
        """The differences that leave the least, and their rate; None if they leave too much.

        The rate is the frame rate, if that is known and fits as well.
        """
        left = {
            coding: 1.0 - float(product / energy * (product / squares))
            for coding, (energy, product, squares) in self._sums.items()
            if energy > 0 and squares > 0 and np.isfinite([energy, product, squares]).all()
        }
        if not left or not min(left.values()) < MOST_LEFT:
            return None
        coding = min(left, key=lambda one: left[one])
        energy, product, squares = self._sums[coding]
        at_fps = 1.0 - float(2.0 * fps * (product / energy) - fps**2 * (squares / energy))
        if at_fps <= max(AS_WELL * left[coding], LEAST_LEFT):
            return coding, fps
        return coding, float(product / squares)


def residuals(
    header: TrackHeader, surface: MovingSurface, positions: Vertices, values: Values
) -> Values:
    """What is left to code of a track of a block.

    Parameters
    ----------
    header : TrackHeader
        Of a track that is predicted.
    surface : MovingSurface
    positions : float array of shape (T_b, V, 3)
        Decoded, as they go out.
    values : float array of shape (T_b, N, 3)
        As they go out. Where one is missing, so is its residual.

    Returns
    -------
    float array of shape (T_b, N, C), of the type of the values

    Raises
    ------
    UnreachableError
        If a normal cannot be reached from that of the surface.
    """
    found = np.empty((*values.shape[:2], header.n_coded), values.dtype)

    def fill(piece: slice) -> None:
        expected = expected_values(header, surface, positions, piece)
        if header.coding is not Coding.TURNS:
            found[piece] = values[piece] - expected
            return
        is_missing = np.isnan(values[piece])
        if np.any(is_missing.any(axis=2) & ~is_missing.all(axis=2)):
            raise UnreachableError("a normal is missing in part")
        wanted = np.where(is_missing, expected, values[piece])
        try:
            found[piece] = find_rotations(expected, wanted)
        except InvalidInputError as error:
            raise UnreachableError(str(error)) from error
        found[piece][is_missing.any(axis=2)] = np.nan

    in_threads(fill, chunks(len(values), max(1, VALUES_AT_ONCE // values.shape[1])))
    return found


def exact_residuals(
    header: TrackHeader, surface: MovingSurface, positions: Vertices, values: Values
) -> Values:
    """What is left to code of an exact track of a block: integers; as `residuals` else."""
    found = places_of(np.ascontiguousarray(values)).copy()

    def subtract(piece: slice) -> None:
        with np.errstate(over="ignore", invalid="ignore"):
            expected = expected_values(header, surface, positions, piece)
        found[piece] -= expected_places(header, expected)

    in_threads(subtract, chunks(len(values), max(1, VALUES_AT_ONCE // values.shape[1])))
    return found
