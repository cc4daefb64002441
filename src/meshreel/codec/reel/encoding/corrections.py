"""Corrections that guarantee an error bound, and the bounds that can be guaranteed."""

from dataclasses import replace

import numpy as np

from meshreel.arrays import Floats
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.codec.reel.normative.blocks import Corrections
from meshreel.errors import InvalidInputError, Keyword
from meshreel.kernel.frames import JointFrames

STEP_OF_BOUND = 1.1
"""Step of corrections, in bounds: half a step along each of three axes is 0.95 of the bound."""

MAX_STEP = 1.0
"""Largest step, in diagonals: no vertex is farther than a diagonal from its true position."""

FLOOR = 2.0**-48
"""Part of a bound, in diagonals, reserved for rounding when a position is corrected and scaled.
Decoded frames are the same bits on every machine, so nothing else needs a reserve."""

MAX_POSITIONS_PER_PASS = 1 << 21
"""Number of positions that are decoded and corrected together."""


def check_error_bound(bound: float, rounding: float, dtype: np.dtype[np.floating]) -> None:
    """Check that an error bound exceeds the rounding of positions.

    Raises
    ------
    InvalidInputError
        If the bound cannot be guaranteed.
    """
    least = rounding + FLOOR
    if bound > least:
        return
    remedy = "" if dtype == np.float64 else "give positions as float64, "
    raise InvalidInputError(
        Keyword("max_error"),
        f" {100 * bound:g} cannot be guaranteed: positions of type {dtype} at these "
        f"coordinates are rounded by up to {100 * rounding:.2g} percent of the diagonal; "
        f"{remedy}encode losslessly, or set at least {101 * least:.2g}",
    )


def corrections_of_block(
    block: BlockFrames,
    decoded: JointFrames,
    bound: float,
    rounding: float,
    *,
    each_column: bool = False,
) -> Corrections:
    """Return the corrections that bring all decoded frames of a block within a bound.

    Parameters
    ----------
    decoded : JointFrames
        The frames that its fields decode to.
    bound, rounding, each_column
        As in `find_corrections`.
    """
    parts = []
    n_together = max(1, MAX_POSITIONS_PER_PASS // block.n_verts)
    for start in range(0, block.n_frames, n_together):
        piece = slice(start, min(start + n_together, block.n_frames))
        errors = block.coordinates(slice(0, block.n_verts), piece)
        errors = errors.reshape(block.n_columns, -1, block.n_verts)
        errors -= decoded(piece)
        part = find_corrections(errors, bound, rounding, each_column=each_column)
        parts.append(replace(part, frames=part.frames + start))
    if len(parts) == 1:
        return parts[0]
    vertices, numbers, offsets = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("vertices", "frames", "offsets")
    )
    order = np.lexsort((numbers, vertices))
    return Corrections(parts[0].step, vertices[order], numbers[order], offsets[order])


def find_corrections(
    errors: Floats, bound: float, rounding: float, *, each_column: bool = False
) -> Corrections:
    """Return corrections that bring all positions, or values of another track, within a bound.

    Parameters
    ----------
    errors : float64 array of shape (C, T, V)
        True minus decoded coordinates, in diagonals; vertices in internal order.
    bound : float
        Largest error, in diagonals.
    rounding : float
        Largest rounding error of a position by its number type, in diagonals.
    each_column : bool, default False
        Whether the bound applies to each column, rather than the length over all columns.

    Returns
    -------
    Corrections, ordered by vertex, then by frame
    """
    allowed = bound - FLOOR - rounding
    n_together = 1 if each_column else len(errors)
    step = np.float32(min(STEP_OF_BOUND * np.sqrt(3.0 / n_together) * allowed, MAX_STEP))
    if each_column:
        squared = np.square(np.abs(errors).max(axis=0))
    else:
        squared = np.einsum("ctv,ctv->tv", errors, errors)
    vertices, frames = np.nonzero(allowed**2 < squared.T)
    offsets = np.rint(errors[:, frames, vertices].T / float(step)).astype(np.int64)
    return Corrections(step, vertices.astype(np.int64), frames.astype(np.int64), offsets)
