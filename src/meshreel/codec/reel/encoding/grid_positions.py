"""The method `grid`: positions rounded to a grid, then coded losslessly.

At bounds near the precision of the positions, modes save little: the residual motion is noise,
which each mode would code twice, in its field and in its basis vector. A single frame has no
motion; it is predicted along its surface, which is faster than prediction over a hierarchy.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from meshreel.arrays import Vertices
from meshreel.codec.bitstream.container import payload_bytes
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.config import EncoderConfig
from meshreel.codec.reel.encoding.block_frames import largest_rounding
from meshreel.codec.reel.encoding.exact_positions import (
    FacesAndTwins,
    PositionCoder,
    stream_of,
    stream_of_positions,
)
from meshreel.codec.reel.encoding.stored_grid import coarse_grid, grid_of_frame
from meshreel.codec.reel.encoding.target_step import checked_bound
from meshreel.codec.reel.encoding.tracks import encode_tracks
from meshreel.codec.reel.normative.blocks import write_exact_positions, write_on_surface
from meshreel.codec.reel.normative.grid import (
    EXACT,
    LOSSLESS,
    MAX_COORDINATE,
    Coordinates,
    PositionGrid,
    write_form,
)
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.source import CodedMesh, Source
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.codec.targets import TargetKind
from meshreel.kernel.surface_integers import MAX_VALUE
from meshreel.model.extent import Extent
from meshreel.model.sequence import is_still
from meshreel.runtime.progress import Progress

RAW_RATIO, FEW_FRAMES, RESTING_SHARE = 16, 20, 0.3
"""Estimated compression by a grid, which is tried if modes compress less, if there are at most
`FEW_FRAMES` frames, or if at least this share of the vertices rests."""

N_COMPARED = 4
"""Number of frames in which resting vertices are counted."""

SLACK = 1e-5
"""Share of a bound that is reserved for rounding in double precision."""


MAX_ROUNDING_BYTES = 1 / 16
"""Maximum size of the roundings that make a frame exact, in bytes per number of the frame."""


@dataclass(frozen=True)
class GridPositionCoder(PositionCoder):
    """Codes blocks of positions on a grid, or losslessly."""

    faces_and_twins: FacesAndTwins
    """tuple of int32 arrays of shape (M, 3) and (3 M,). Internal faces, and the twin of each
    half-edge, itself at a boundary.
    """
    grid: PositionGrid
    is_stored: bool = False
    """Whether the only frame already lies on this grid, so that it may be coded exactly."""
    is_fast: bool = False
    """Whether to try only integers on the surface, unless they exceed their limits."""

    @property
    def is_exact(self) -> bool:
        """False: blocks on a grid are lossy."""
        return False

    def code(self, vertices: Vertices) -> list[tuple[Section, bytes]]:
        """Encode a contiguous block of shape (T_b, V, 3), in internal order.

        Positions are lossless if the grid exceeds the bound or the limits of the format, or if
        that takes fewer bytes for several frames.
        """
        coordinates, step = self.grid.coordinates(vertices), self.grid.step
        meets_bound = self._meets_bound(coordinates, vertices)
        is_single = (coordinates[1:] == coordinates[0]).all()
        rounding = None
        if self.is_stored and is_single:
            rounding = self.grid.rounding(coordinates[:1], vertices[:1])
        if rounding and meets_bound and len(rounding) > vertices[0].size * MAX_ROUNDING_BYTES:
            rounding = None
        candidates = []
        is_precise = meets_bound or rounding is not None
        if is_precise and np.abs(coordinates).max() <= MAX_VALUE:
            coded_frames, n_frames = coordinates[:1] if is_single else coordinates, len(vertices)
            candidates.append(
                write_on_surface(
                    coded_frames, step, *self.faces_and_twins, rounding, n_frames=n_frames
                )
            )
            if is_single or self.is_fast:
                return candidates[0]
        candidates.append(write_exact_positions(vertices, self.graph, bytes([LOSSLESS])))
        if len(vertices) > 1 and meets_bound:
            form = write_form(EXACT, step)
            candidates.append(write_exact_positions(coordinates, self.graph, form))
        return min(candidates, key=payload_bytes)

    def _meets_bound(self, coordinates: Coordinates, vertices: Vertices) -> bool:
        if self.bound is None:
            return True
        decoded = self.grid.positions(coordinates, vertices.dtype).astype(np.float64)
        error = (decoded - vertices) / self.grid.frame.scale
        return math.sqrt(float(np.einsum("tvc,tvc->tv", error, error).max())) <= self.bound


def grid_coder(
    mesh: CodedMesh, frame: BoundingFrame, extent: Extent, dtype: np.dtype[np.floating]
) -> GridPositionCoder:
    """Return the coder of a mesh whose options set `max_error` or `step`.

    Parameters
    ----------
    extent : Extent
        Extent of the positions known so far.
    dtype : dtype
        Number type of the positions.

    Raises
    ------
    InvalidInputError
        If the number type is too coarse for the bound.
    """
    config = mesh.config
    assert isinstance(config, ReelOptions)  # the options of this method
    target = config.target
    if target.kind is TargetKind.STEP:
        return step_coder(mesh, frame, target.value)
    rounding = largest_rounding(extent.low.min(), extent.high.max(), dtype, frame)
    bound = checked_bound(target, frame.scale, rounding, dtype)
    # The error is at most half the diagonal of a cube, plus half of the rounding.
    step = (bound * (1.0 - SLACK) - 0.5 * rounding) * 2.0 / math.sqrt(3.0)
    return replace(step_coder(mesh, frame, step), bound=bound)


def step_coder(mesh: CodedMesh, frame: BoundingFrame, step: float) -> GridPositionCoder:
    """Return the coder of a mesh with a grid of a step in diagonals, if coordinates allow it.

    The step becomes the next smaller number in single precision.
    """
    single = np.float32(step := _allowed(step))
    single = single if single <= step else np.nextafter(single, np.float32(0))
    grid = PositionGrid(float(single), frame)
    return GridPositionCoder(mesh.links, mesh.n_verts, mesh.faces_and_twins, grid)


def encode(source: Source, progress: Progress, step: float | None = None) -> bytes:
    """Return a stream of the source with positions on a grid.

    Parameters
    ----------
    step : float, optional
        Step in diagonals. Default: that of the options, or of their bound.

    Raises
    ------
    InvalidInputError
        If a bound cannot be guaranteed.
    """
    source = source.with_changes(tracks=encode_tracks(source, progress))
    bids = GridBids(source, is_still(source.sequence), step)
    return stream_of(*bids.on_target_grid, progress)


def suits_one_frame(source: Source) -> bool:
    """Return whether a segment has one frame, and no option requires modes.

    Modes on a hierarchy take up to a quarter fewer bytes, but decode too slowly for segments that
    play in real time. For a file of a single frame, both are tried, and the smaller one is kept.
    """
    return source.n_frames == 1 and _takes_grid(source.config)


def frame_error(source: Source, vertices: Vertices, step: float) -> float:
    """Return the sum of squared distances of a frame (1, V, 3) from a grid, in diagonals."""
    grid = PositionGrid(_allowed(step), source.frame)
    error = grid.positions(grid.coordinates(vertices), vertices.dtype).astype(np.float64) - vertices
    error /= source.frame.scale
    return float(np.vdot(error, error))


class Bid(NamedTuple):
    """A grid with the estimated size of the stream."""

    estimated_bytes: float
    """0 if only encoding tells."""
    source: Source
    coder: GridPositionCoder


@dataclass(frozen=True)
class GridBids:
    """Grids on which positions may take fewer bytes than as modes."""

    source: Source
    """Its tracks are encoded."""
    has_one_shape: bool
    step: float | None
    """Step in diagonals; None: that of the options, or of their bound."""
    n_bytes: float = math.inf
    """Bytes of the stream of modes."""

    def streams(self, progress: Progress) -> Iterator[tuple[bytes, Source]]:
        """Yield streams that may take fewer bytes than modes, and their sources.

        Those with the lowest estimate come first. Options that require modes exclude them.
        """
        bids = (self.of_target, self.of_stored_grid) if _takes_grid(self.source.config) else ()
        for bid in sorted(filter(None, bids), key=lambda bid: bid.estimated_bytes):
            if bid.estimated_bytes < self.n_bytes:
                yield stream_of_positions(bid.source, bid.coder, progress), bid.source

    @cached_property
    def of_target(self) -> Bid | None:
        """A grid that meets the target; None for a measured error or size, or a step of modes."""
        if self._target in (TargetKind.KG, TargetKind.SIZE):
            return None
        if self._target is TargetKind.STEP and not self.has_one_shape:
            return None
        is_unknown = self.has_one_shape or self.source.n_frames <= FEW_FRAMES
        if is_unknown or _resting_share(self.source) >= RESTING_SHARE:
            return Bid(0.0, *self.on_target_grid)
        if self._moving_bytes >= self.n_bytes:
            return None  # the grid need not be chosen
        return Bid(self._moving_bytes, *self.on_target_grid)

    @property
    def of_stored_grid(self) -> Bid | None:
        """The grid of the quantizer that rounded the only shape, if finer than the target's."""
        grid, of_target = self._stored_grid, self.of_target
        if grid is None or self._target is TargetKind.MAX_ERROR:
            return None
        if of_target is not None and of_target.coder.is_stored:
            return None
        coder = replace(step_coder(self.source.mesh, grid.frame, grid.step), is_stored=True)
        shifted = self.source.with_changes(origin=grid.frame.origin)
        return Bid(0.0, _on_grid(shifted, grid.step), coder)

    @cached_property
    def on_target_grid(self) -> tuple[Source, GridPositionCoder]:
        """The source and its coder, on a grid that meets the target.

        This is the stored grid if it is coarser than that of the target; otherwise a coarse one
        with equally small errors, if few frames lie near one. Exact values are tried only for a
        bound with which modes do not compress well.
        """
        source, grid = _on_grid(self.source, self.step), self._stored_grid
        sequence = source.sequence
        coder = grid_coder(source.mesh, source.frame, sequence.extent, sequence.dtype)
        is_fast = self._target is TargetKind.QUALITY or self._moving_bytes >= self.n_bytes
        coder = replace(coder, is_fast=is_fast)
        if grid is not None and grid.step > coder.grid.step:
            on_stored = replace(coder, grid=grid, is_stored=True)
            frame = sequence.read(0, 1)
            coordinates = grid.coordinates(frame)
            if on_stored._meets_bound(coordinates, frame) or grid.rounding(coordinates, frame):
                return source.with_changes(origin=grid.frame.origin), on_stored
        coarse = _coarse_grid(source, coder) if source.n_frames <= FEW_FRAMES else None
        if coarse is not None:
            return source.with_changes(origin=coarse.frame.origin), replace(coder, grid=coarse)
        return source, coder

    @property
    def _target(self) -> TargetKind:
        config = self.source.config
        assert isinstance(config, ReelOptions)  # the options of this method
        return config.target.kind

    @cached_property
    def _stored_grid(self) -> PositionGrid | None:
        return grid_of_frame(self.source) if self.has_one_shape else None

    @property
    def _moving_bytes(self) -> float:
        """Estimated bytes of moving positions: a grid stores a number for each of them."""
        source = self.source
        return 3 * source.dtype.itemsize * source.n_frames * source.mesh.n_verts / RAW_RATIO


def _resting_share(source: Source) -> float:
    """Return the mean share of vertices that rest between some frames and the frames after them."""
    sequence, n_frames = source.sequence, source.n_frames
    shares = []
    for first in range(0, n_frames - 1, math.ceil(n_frames / N_COMPARED)):
        frame, following = sequence.read(first, first + 2)
        shares.append(np.mean((frame == following).all(axis=1)))
    return float(np.mean(shares))


def _takes_grid(config: EncoderConfig) -> bool:
    """Whether no option requires modes."""
    assert isinstance(config, ReelOptions)  # the options of this method
    return config.effort is None and config.tune is None and config.n_modes is None


def _on_grid(source: Source, step: float | None) -> Source:
    """Return the source with the method `grid`, and a step in diagonals unless that is None."""
    block_frames = source.block_frames if source.tracks else source.config.block_frames
    changes: dict[str, Any] = {"method": "grid", "block_frames": block_frames}
    if step is not None:
        targets = "bound", *(kind.value for kind in TargetKind)
        changes |= {**dict.fromkeys(targets), "step": _allowed(step)}
    return source.with_changes(config=replace(source.mesh.config, **changes))


def _allowed(step: float) -> float:
    """Clip a step, in diagonals, to the range that the format and the coordinates allow."""
    return min(max(step, 1.0 / MAX_COORDINATE), 1.0)


def _coarse_grid(source: Source, coder: GridPositionCoder) -> PositionGrid | None:
    """Return a coarser grid than that of the coder, with equally small errors; None without one."""
    sequence, step = source.sequence, coder.grid.step * source.frame.scale

    def read(index: int) -> Vertices:
        frame: Vertices = sequence.read(index, index + 1)[0]
        return frame

    # RMS errors are at most those of the coder's grid, or largest ones if these are bounded.
    tolerance = step / (2.0 if coder.bound is not None else math.sqrt(12.0))
    coarse = coarse_grid(source.n_frames, read, sequence.extent, tolerance)
    if coarse is None:
        return None
    step, origin = coarse
    frame = replace(source.frame, origin=origin)
    grid = step_coder(source.mesh, frame, step / frame.scale).grid
    coder, frames = replace(coder, grid=grid), (read(i)[None] for i in range(source.n_frames))
    meets_bound = all(coder._meets_bound(grid.coordinates(frame), frame) for frame in frames)
    return grid if meets_bound else None
