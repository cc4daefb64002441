"""The method `lossless`: positions to the sections of a stream, from which every bit comes back."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import chain, islice
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import Sections
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.reel.encoding.following_tracks import FollowingTracks
from meshreel.codec.reel.encoding.tracks import coded_tracks, live_tracks
from meshreel.codec.reel.normative.blocks import write_exact_positions
from meshreel.codec.source import CodedMesh, Piece, Source
from meshreel.codec.track_bounds import TrackTargets
from meshreel.errors import SolverError
from meshreel.kernel.exact import decode_exact
from meshreel.kernel.mesh import Neighbors, neighbors
from meshreel.model.sequence import Faces
from meshreel.model.tracks import Track
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Count, Progress
from meshreel.runtime.threads import in_threads, n_cores

Vertices = npt.NDArray[np.floating]
CodedBlock = tuple[int, list[tuple[Section, bytes]]]

MOST_TOGETHER = 4
"""Blocks that are coded at once, where nothing is said of memory."""


@dataclass(frozen=True)
class PositionCoder(ABC):
    """Codes blocks of positions as values; none depends on another.

    Attributes
    ----------
    faces : int32 array of shape (M, 3)
        In internal order.
    n_verts : int
    """

    faces: Faces
    n_verts: int

    @cached_property
    def graph(self) -> Neighbors:
        """The vertices next to each vertex."""
        return neighbors(self.faces, self.n_verts)

    def __reduce__(self) -> tuple[Any, ...]:  # neighbors are found again where they are needed
        return type(self), tuple(getattr(self, each.name) for each in fields(self))

    @property
    @abstractmethod
    def is_exact(self) -> bool:
        """Whether positions are decoded as they are."""

    @abstractmethod
    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """The sections before the first block, behind those of the mesh."""

    @abstractmethod
    def code(self, vertices: Vertices) -> list[tuple[Section, bytes]]:
        """The sections of a block of shape (T_b, V, 3), in internal order and contiguous."""

    def code_piece(self, piece: Piece) -> CodedBlock:
        """Number of frames and sections of a block that is still to be read."""
        vertices = piece.read()
        return len(vertices), self.code(vertices)


@dataclass(frozen=True)
class ExactPositionCoder(PositionCoder):
    """Codes blocks of positions from which every bit comes back."""

    @property
    def is_exact(self) -> bool:
        """Always."""
        return True

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """There are none."""
        return iter(())

    def code(self, vertices: Vertices) -> list[tuple[Section, bytes]]:
        """The sections of a block of shape (T_b, V, 3), in internal order and contiguous.

        They are decoded again, and compared.

        Raises
        ------
        SolverError
            If a bit would not come back.
        """
        block, values = write_exact_positions(vertices, self.graph)
        found = decode_exact(values[1], vertices.shape, vertices.dtype, self.graph)
        if not np.array_equal(found.view(np.uint8), vertices.view(np.uint8)):
            raise SolverError(
                "positions do not come back bit for bit; nothing is written; please report this "
                "sequence"
            )
        return [block, values]


def encode(source: Source, progress: Progress, engine: Engine | None) -> bytes:
    """The bytes of a stream of the source whose positions are exact.

    Parameters
    ----------
    source : Source
    progress : callable
    engine : Engine or None
        Whose workers code the blocks; None codes them here.

    Raises
    ------
    InvalidInputError
        If the bound of a track cannot be promised.
    SolverError
        As `ExactPositionCoder.code`.
    """
    source = replace(source, tracks=coded_tracks(source, progress))
    coder = ExactPositionCoder(source.mesh.faces, source.mesh.n_verts)
    return stream_of(source, coder, progress, engine)


def stream_of(
    source: Source, coder: PositionCoder, progress: Progress, engine: Engine | None
) -> bytes:
    """The bytes of a stream whose tracks are coded already.

    Parameters
    ----------
    source : Source
    coder : PositionCoder
    progress, engine
        As of `encode`.
    """
    blocks: Iterator[CodedBlock]
    if engine is not None:
        blocks = iter(engine.map_in_order(coder.code_piece, ((one,) for one in source.pieces())))
    else:
        n_together = 1 if source.config.memory is not None else min(n_cores(), MOST_TOGETHER)
        blocks = _coded(coder, source.pieces(), n_together)
    coded = _told(blocks, source.sequence.n_frames, progress)
    data = source.stream(coder.leading_sections(), coded)
    return FollowingTracks(source, progress).stream(data) if source.tracks else data


def _coded(coder: PositionCoder, pieces: Iterator[Piece], n_together: int) -> Iterator[CodedBlock]:
    """Frames and sections of each block; so many are coded at once, on as many cores."""
    while several := [piece.read() for piece in islice(pieces, n_together)]:
        yield from _at_once(coder, several)


def _at_once(coder: PositionCoder, blocks: list[Vertices]) -> list[CodedBlock]:
    coded: dict[int, list[tuple[Section, bytes]]] = {}

    def code(number: int) -> None:
        coded[number] = coder.code(blocks[number])

    in_threads(code, range(len(blocks)))
    return [(len(vertices), coded[number]) for number, vertices in enumerate(blocks)]


def _told(
    blocks: Iterator[CodedBlock], n_frames: int, progress: Progress
) -> Iterator[tuple[int, Sections]]:
    """The blocks, while the listener is told how many of their frames are coded."""
    done = 0
    progress("encoding", Count(done, n_frames, "frames"))
    for n_coded, sections in blocks:
        yield n_coded, sections
        done += n_coded
        progress("encoding", Count(done, n_frames, "frames"))


class LivePositionCoder:
    """Codes blocks of frames as they come.

    Parameters
    ----------
    coder : PositionCoder
    mesh : CodedMesh
    first : float array of shape (T_b, V, 3)
        The first block, in internal order.
    tracks : dict of str to Track
        Values of the first block: bounds that are shares are of their range in it.
    targets : mapping of str to str or float, or None
        How exact they are to come back.

    Raises
    ------
    InvalidInputError
        If the bound of a track cannot be promised.
    """

    def __init__(
        self,
        coder: PositionCoder,
        mesh: CodedMesh,
        first: Vertices,
        tracks: Mapping[str, Track],
        targets: TrackTargets | None,
    ) -> None:
        self._coder, self._mesh = coder, mesh
        positions = (lambda: self._as_they_go_out(first)) if coder.is_exact else None
        self._tracks = live_tracks(mesh, tracks, targets, positions)

    def _as_they_go_out(self, vertices: Vertices) -> Vertices:
        """Exact positions, in internal order, as a reader has them."""
        return vertices.take(self._mesh.output_order, axis=1)

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """The sections before the first block, behind those of the mesh."""
        of_tracks = (track.leading_section() for track in self._tracks.values())
        return chain(self._coder.leading_sections(), of_tracks)

    def code(self, vertices: Vertices, tracks: Mapping[str, Track]) -> Sections:
        """The sections of the next block, given in internal order; tracks in the given one.

        Raises
        ------
        InvalidInputError
            If values of a track do not allow the promised bound.
        """
        is_needed = bool(self._tracks) and self._coder.is_exact
        positions = self._as_they_go_out(vertices) if is_needed else None
        others = [
            coder.code(tracks[name].values, positions) for name, coder in self._tracks.items()
        ]
        return chain(self._coder.code(vertices), *others)
