"""The method `grid`: positions rounded to a grid within an error bound, then coded losslessly.

At bounds near the precision of the positions, modes save little: the residual motion is noise,
which each mode would code twice, in its field and in its basis vector.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.layout import Section
from meshreel.codec.reel.encoding.block_coder import largest_rounding, write_promise
from meshreel.codec.reel.encoding.exact_positions import PositionCoder, stream_of
from meshreel.codec.reel.encoding.target_step import promised_bound
from meshreel.codec.reel.encoding.tracks import encode_tracks
from meshreel.codec.reel.normative.blocks import write_grid_positions
from meshreel.codec.reel.normative.grid import MAX_COORDINATE, NO_GRID, Coordinates, PositionGrid
from meshreel.codec.source import CodedMesh, Source
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.model.sequence import Extent
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Progress

Vertices = npt.NDArray[np.floating]

RAW_RATIO = 16
"""Modes that compress less than this many times are compared to a grid."""

SLACK = 1e-5
"""Share of a bound that is reserved for rounding in double precision."""


@dataclass(frozen=True)
class GridPositionCoder(PositionCoder):
    """Codes blocks of positions on a grid, or losslessly.

    Attributes
    ----------
    grid : PositionGrid
    bound : float
        Largest error of a position, in diagonals.
    """

    grid: PositionGrid
    bound: float

    @property
    def is_exact(self) -> bool:
        """False: blocks on a grid are lossy."""
        return False

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """Yield the sections before the first block."""
        yield Section.PROMISE, write_promise(100.0 * self.bound)

    def code(self, vertices: Vertices) -> list[tuple[Section, bytes]]:
        """Encode a contiguous block of shape (T_b, V, 3), in internal order.

        Positions are lossless if that takes fewer bytes, or the grid exceeds the bound.
        """
        exact = write_grid_positions(vertices, NO_GRID, self.graph)
        coordinates = self.grid.coordinates(vertices)
        if not self._meets_bound(coordinates, vertices):
            return exact
        rounded = write_grid_positions(coordinates, self.grid.step, self.graph)
        return min(exact, rounded, key=lambda sections: len(sections[1][1]))

    def _meets_bound(self, coordinates: Coordinates, vertices: Vertices) -> bool:
        decoded = self.grid.positions(coordinates, vertices.dtype).astype(np.float64)
        error = (decoded - vertices) / self.grid.frame.scale
        return math.sqrt(float(np.einsum("tvc,tvc->tv", error, error).max())) <= self.bound


def grid_coder(
    mesh: CodedMesh, frame: BoundingFrame, extent: Extent, dtype: np.dtype[np.floating]
) -> GridPositionCoder:
    """Return the coder of a mesh whose options set `max_error`.

    Parameters
    ----------
    mesh : CodedMesh
    frame : BoundingFrame
    extent : Extent
        Extent of the positions known so far.
    dtype : dtype
        Number type of the positions.

    Raises
    ------
    InvalidInputError
        If the number type is too coarse for the bound.
    """
    rounding = largest_rounding(extent.low.min(), extent.high.max(), dtype, frame)
    bound = promised_bound(mesh.config.target, frame.scale, rounding, dtype)
    # The error is at most half the diagonal of a cube, plus half of the rounding.
    step = (bound * (1.0 - SLACK) - 0.5 * rounding) * 2.0 / math.sqrt(3.0)
    grid = PositionGrid(min(max(step, 1.0 / MAX_COORDINATE), 1.0), frame)
    return GridPositionCoder(mesh.faces, mesh.n_verts, grid, bound)


def encode(source: Source, progress: Progress, engine: Engine | None) -> bytes:
    """Return a stream of the source with positions on a grid; parameters as in `whole.encode`.

    Raises
    ------
    InvalidInputError
        If a bound cannot be guaranteed.
    """
    return _encoded(replace(source, tracks=encode_tracks(source, progress)), progress, engine)


def may_use_grid(source: Source, size_bytes: int) -> bool:
    """Return whether a grid might take fewer bytes than a stream of modes of this size.

    A grid stores a number for each position, so it cannot compress many times. Options of the
    search for modes exclude it.
    """
    config = source.config
    if any(option is not None for option in (config.effort, config.tune, config.n_modes)):
        return False
    raw_bytes = 3 * source.dtype.itemsize * source.n_frames * source.mesh.n_verts
    return size_bytes * RAW_RATIO > raw_bytes


def encode_on_grid(source: Source, progress: Progress, engine: Engine | None) -> bytes:
    """Return a stream of the method `grid` of a source of `reel`, with its coded tracks."""
    cut = source.block_frames if source.tracks else source.config.block_frames
    config = replace(source.config, method="grid", block_frames=cut)
    return _encoded(replace(source, config=config), progress, engine)


def _encoded(source: Source, progress: Progress, engine: Engine | None) -> bytes:
    sequence = source.sequence
    coder = grid_coder(source.mesh, source.frame, sequence.extent, sequence.dtype)
    return stream_of(source, coder, progress, engine)
