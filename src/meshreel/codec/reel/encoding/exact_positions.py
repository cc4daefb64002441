"""The method `lossless`: bit-exact coding of positions."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Vertices
from meshreel.codec.achieved import require_exact
from meshreel.codec.bitstream.container import error_bound_sections, payload_bytes
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.reel.encoding.following_tracks import FollowingTracks
from meshreel.codec.reel.encoding.stored_grid import grid_of_frame
from meshreel.codec.reel.encoding.tracks import encode_tracks
from meshreel.codec.reel.normative.blocks import write_exact_positions, write_on_surface
from meshreel.codec.reel.normative.grid import PositionGrid
from meshreel.codec.source import Source, reporting_frames
from meshreel.kernel.mesh import Neighbors, neighbors
from meshreel.kernel.surface_integers import MAX_VALUE
from meshreel.model.sequence import Faces
from meshreel.runtime.progress import Progress
from meshreel.runtime.threads import in_threads, n_cores

FacesAndTwins = tuple[Faces, npt.NDArray[np.int32]]
CodedBlock = tuple[int, list[tuple[Section, bytes]]]

MAX_PARALLEL_BLOCKS = 4
"""Number of blocks encoded in parallel without a memory limit."""


@dataclass(frozen=True)
class PositionCoder(ABC):
    """Encodes independent blocks of positions."""

    links: Faces
    """int32 array of shape (n, 3). The graph of internal vertices as triangles."""
    n_verts: int
    bound: float | None = field(default=None, kw_only=True)
    """Largest error of a position that is not lossless, in diagonals; None guarantees nothing."""

    @cached_property
    def graph(self) -> Neighbors:
        """Adjacent vertices of each vertex."""
        return neighbors(self.links, self.n_verts)

    @property
    @abstractmethod
    def is_exact(self) -> bool:
        """Whether positions are lossless."""

    def leading_sections(self) -> list[tuple[Section, bytes]]:
        """Return the sections before the first block of live frames."""
        return error_bound_sections(None if self.bound is None else 100.0 * self.bound)

    @abstractmethod
    def code(self, vertices: Vertices) -> list[tuple[Section, bytes]]:
        """Encode a contiguous block of shape (T_b, V, 3), in internal order."""


@dataclass(frozen=True)
class ExactPositionCoder(PositionCoder):
    """Encodes blocks of positions losslessly."""

    faces_and_twins: FacesAndTwins | None = None
    """tuple of int32 arrays of shape (M, 3) and (3 M,). Internal faces, and the twin of each
    half-edge, itself at a boundary. Needed with `grid`.
    """
    grid: PositionGrid | None = None
    """Grid of the quantizer that rounded the positions of the only frame."""

    @property
    def is_exact(self) -> bool:
        """Always true."""
        return True

    def code(self, vertices: Vertices) -> list[tuple[Section, bytes]]:
        """Encode a contiguous block of shape (T_b, V, 3), in internal order."""
        exact = write_exact_positions(vertices, self.graph)
        if self.grid is None or self.faces_and_twins is None:
            return exact
        coordinates = self.grid.coordinates(vertices)
        rounding = self.grid.rounding(coordinates, vertices)
        if rounding is None or np.abs(coordinates).max() > MAX_VALUE:
            return exact
        on_grid = write_on_surface(coordinates, self.grid.step, *self.faces_and_twins, rounding)
        return min(exact, on_grid, key=payload_bytes)


def encode(source: Source, progress: Progress) -> bytes:
    """Encode the source to a stream with lossless positions.

    Raises
    ------
    InvalidInputError
        If the bound of a track cannot be guaranteed.
    SolverError
        If positions or lossless tracks do not decode to the same bits.
    """
    source = source.with_changes(tracks=encode_tracks(source, progress))
    coder = ExactPositionCoder(source.mesh.links, source.mesh.n_verts)
    if source.n_frames == 1 and (grid := grid_of_frame(source)):
        source = source.with_changes(origin=grid.frame.origin)
        coder = replace(coder, faces_and_twins=source.mesh.faces_and_twins, grid=grid)
    data = stream_of(source, coder, progress)
    progress("verifying", 0.0)
    require_exact(source.sequence, data)
    return data


def stream_of(source: Source, coder: PositionCoder, progress: Progress) -> bytes:
    """Encode the source to a stream, with tracks that follow from its positions."""
    data = stream_of_positions(source, coder, progress)
    return FollowingTracks(source, progress).stream(data) if source.tracks else data


def stream_of_positions(source: Source, coder: PositionCoder, progress: Progress) -> bytes:
    """Encode the source to a stream; its tracks are already encoded."""
    n_together = 1 if source.config.memory is not None else min(n_cores(), MAX_PARALLEL_BLOCKS)
    blocks = _encode_blocks(coder, source.blocks(), n_together)
    coded = reporting_frames(blocks, source.n_frames, progress)
    return source.stream([], coded, 0.0 if coder.is_exact else coder.bound)


def _encode_blocks(
    coder: PositionCoder, blocks: Iterator[Vertices], n_together: int
) -> Iterator[CodedBlock]:
    """Yield frames and sections of each block, encoding several in parallel."""
    while group := list(islice(blocks, n_together)):
        yield from zip(map(len, group), in_threads(coder.code, group), strict=True)
