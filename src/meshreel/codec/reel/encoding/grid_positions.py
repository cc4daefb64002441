"""The method `grid`: positions rounded to a grid whose cubes keep a promise, and coded exactly.

Where nearly every bit is wanted modes have little to save: what is left of a motion is noise, which
each of them would send twice, in its field and in its basis vector.
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
from meshreel.codec.reel.encoding.tracks import coded_tracks
from meshreel.codec.reel.normative.blocks import write_grid_positions
from meshreel.codec.reel.normative.grid import MOST_NUMBER, NO_GRID, PositionGrid
from meshreel.codec.source import CodedMesh, Source
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.model.sequence import Extent
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Progress

Vertices = npt.NDArray[np.floating]

RAW_SHARE = 16
"""Modes that take more than one of so many of the raw bytes are compared to a grid."""

SLACK = 1e-5
"""Share of a bound that is left for rounding in double precision."""


@dataclass(frozen=True)
class GridPositionCoder(PositionCoder):
    """Codes blocks of positions on a grid, or as they are.

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
        """Not where a grid takes fewer bytes."""
        return False

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """The sections before the first block."""
        yield Section.PROMISE, write_promise(100.0 * self.bound)

    def code(self, vertices: Vertices) -> list[tuple[Section, bytes]]:
        """The sections of a block of shape (T_b, V, 3), in internal order and contiguous.

        Positions stay as they are where that takes fewer bytes, or a grid does not keep the bound.
        """
        exact = write_grid_positions(vertices, NO_GRID, self.graph)
        numbers = self.grid.numbers(vertices)
        if not self._keeps(numbers, vertices):
            return exact
        rounded = write_grid_positions(numbers, self.grid.step, self.graph)
        return min(exact, rounded, key=lambda sections: len(sections[1][1]))

    def _keeps(self, numbers: npt.NDArray[np.int32], vertices: Vertices) -> bool:
        found = self.grid.positions(numbers, vertices.dtype).astype(np.float64)
        apart = (found - vertices) / self.grid.frame.scale
        return math.sqrt(float(np.einsum("tvc,tvc->tv", apart, apart).max())) <= self.bound


def grid_coder(
    mesh: CodedMesh, frame: BoundingFrame, extent: Extent, dtype: np.dtype[np.floating]
) -> GridPositionCoder:
    """The coder of a mesh whose options name a largest error.

    Parameters
    ----------
    mesh : CodedMesh
    frame : BoundingFrame
    extent : Extent
        Of the positions, or of those that are known.
    dtype : dtype
        Of the positions.

    Raises
    ------
    InvalidInputError
        If the number type does not allow to promise it.
    """
    rounding = largest_rounding(extent.low.min(), extent.high.max(), dtype, frame)
    bound = promised_bound(mesh.config.target, frame.scale, rounding, dtype)
    # Half a diagonal of a cube, and half of what rounding to the number type may add.
    step = (bound * (1.0 - SLACK) - 0.5 * rounding) * 2.0 / math.sqrt(3.0)
    grid = PositionGrid(min(max(step, 1.0 / MOST_NUMBER), 1.0), frame)
    return GridPositionCoder(mesh.faces, mesh.n_verts, grid, bound)


def encode(source: Source, progress: Progress, engine: Engine | None) -> bytes:
    """The bytes of a stream of the source whose positions lie on a grid.

    Parameters
    ----------
    source : Source
    progress : callable
    engine : Engine or None
        Whose workers code the blocks; None codes them here.

    Raises
    ------
    InvalidInputError
        If a bound cannot be promised.
    """
    return _encoded(replace(source, tracks=coded_tracks(source, progress)), progress, engine)


def may_lie_on_grid(source: Source, size_bytes: int) -> bool:
    """Whether a stream of modes, of so many bytes, is to be compared to one of a grid.

    Where it is many times smaller than the positions, a grid is not: it has a number of some bits
    for each. And options that say how modes are to be found ask for modes.
    """
    config = source.config
    if any(option is not None for option in (config.effort, config.tune, config.n_modes)):
        return False
    raw_bytes = 3 * source.dtype.itemsize * source.n_frames * source.mesh.n_verts
    return size_bytes * RAW_SHARE > raw_bytes


def on_grid(source: Source, progress: Progress, engine: Engine | None) -> bytes:
    """A stream of the method `grid` in place of one of modes; its tracks are coded already."""
    cut = source.block_frames if source.tracks else source.config.block_frames
    config = replace(source.config, method="grid", block_frames=cut)
    return _encoded(replace(source, config=config), progress, engine)


def _encoded(source: Source, progress: Progress, engine: Engine | None) -> bytes:
    sequence = source.sequence
    coder = grid_coder(source.mesh, source.frame, sequence.extent, sequence.dtype)
    return stream_of(source, coder, progress, engine)
