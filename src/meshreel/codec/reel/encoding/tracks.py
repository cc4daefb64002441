"""Tracks beside the positions: how fine they have to be."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.reel.encoding.effort import STEPS_OF_BOUND
from meshreel.codec.reel.encoding.rate_control import least_cost
from meshreel.codec.reel.encoding.shared_corners import SharedTrack, shared_track
from meshreel.codec.reel.encoding.track_coders import (
    ExactTrackCoder,
    PreparedValues,
    Sections,
    TrackCoder,
    exact_coder,
    track_coder,
)
from meshreel.codec.reel.encoding.track_residuals import (
    DifferenceFit,
    moving_surface,
)
from meshreel.codec.source import CodedMesh, CodedTrack, Source
from meshreel.codec.track_bounds import EXACT, TrackBound, TrackTargets, kept_bounds
from meshreel.codec.tracks import Coding, Sharing
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind, TrackSource, value_range
from meshreel.runtime.progress import Count, Progress

Values = npt.NDArray[Any]
Vertices = npt.NDArray[np.floating]
Integers = npt.NDArray[np.int64]

RAW_SHARE = 8
"""Where a track takes more than one of so many of its raw bytes, it is coded exactly too."""

MOST_TRIALS = 6
"""Steps of a track that are tried."""

SMALL_ROWS = 0.1
"""Where to say which corners share values takes more than this share of the values' bytes, corners
are tried with values of their own, too."""


def coded_tracks(source: Source, progress: Progress) -> list[CodedTrack]:
    """The tracks of a sequence that is all there, each within its bound.

    Those that positions may predict are coded once, for `FollowingTracks` finds their steps.

    Raises
    ------
    InvalidInputError
        If a bound cannot be guaranteed.
    """
    found = []
    for number, (name, bound) in enumerate(source.bounds.items()):
        progress("encoding tracks", Count(number, len(source.bounds), "tracks"))
        track = _as_stored(name, source.sequence.tracks[name], bound, source)
        way = _prediction(source, track, bound)
        n_trials = MOST_TRIALS if way is None else 1
        coded = coded_track(name, track, bound, source.mesh, block_ranges(source), n_trials)
        found.append(coded if way is None else replace(coded, prediction=way, values=track))
    return found


def _as_stored(name: str, track: TrackSource, bound: TrackBound, source: Source) -> TrackSource:
    """A track, or the one of the values that its corners share, where that takes fewer bytes."""

    def values_bytes(one: TrackSource) -> int:
        return coded_track(name, one, bound, source.mesh, block_ranges(source), 1).size_bytes

    shared = shared_track(track, source.mesh)
    if shared is None or shared.sharing is Sharing.VERTICES:
        return shared or track
    size_bytes = values_bytes(shared)
    if len(shared.rows) <= SMALL_ROWS * size_bytes:
        return shared
    return shared if len(shared.rows) + size_bytes < values_bytes(track) else track


def coded_track(
    name: str,
    track: TrackSource,
    bound: TrackBound,
    mesh: CodedMesh,
    pieces: Sequence[slice],
    n_trials: int,
) -> CodedTrack:
    """A track of a sequence that is all there.

    The step is the one of those tried that takes the fewest bytes, corrections included.

    Parameters
    ----------
    name : str
    track : TrackSource
    bound : TrackBound
    mesh : CodedMesh
    pieces : sequence of slice
        Frames of each block.
    n_trials : int
        Steps that are tried.

    Raises
    ------
    InvalidInputError
        If the bound cannot be guaranteed.
    """
    if bound == EXACT:
        return coded_exactly(exact_coder(name, track, mesh), track, pieces)
    coder = track_coder(name, track, bound, mesh, value_range(track))
    _, fitted = StepSearch(coder, track, pieces).best(n_trials)
    if fitted.size_bytes * RAW_SHARE < math.prod(track.shape) * track.dtype.itemsize:
        return fitted
    exact = coded_exactly(coder.as_exact, track, pieces)
    return min(fitted, exact, key=lambda one: one.size_bytes)


def _prediction(
    source: Source, track: TrackSource, bound: TrackBound
) -> tuple[Coding, float] | None:
    """How a track may follow from positions, and its rate.

    Exact values do so only from positions that are exact.
    """
    if track.kind is TrackKind.NORMAL and bound != EXACT:
        return Coding.TURNS, 0.0
    if not _is_velocity(track):
        return None
    if bound == EXACT and not (source.config.method_row.is_lossless and track.dtype.kind == "f"):
        return None
    fit = DifferenceFit()
    for piece in block_ranges(source):
        fit.add(track.read(piece.start, piece.stop), source.sequence.read(piece.start, piece.stop))
    return fit.best(source.sequence.fps)


def _is_velocity(track: TrackSource) -> bool:
    """Whether it is one of vertices, which positions may tell."""
    is_of_vertices = track.domain is Domain.VERTEX
    if isinstance(track, SharedTrack):
        is_of_vertices = track.sharing is Sharing.VERTICES
    return track.kind is TrackKind.VELOCITY and is_of_vertices


def block_ranges(source: Source) -> list[slice]:
    """Frames of each block."""
    return [slice(piece.start, piece.stop) for piece in source.pieces()]


def live_track(
    name: str,
    first: TrackSource,
    bound: TrackBound,
    mesh: CodedMesh,
    positions: Callable[[], Vertices] | None,
) -> TrackCoder | ExactTrackCoder:
    """The coder of a track of which the first block is known: that decides the step of all.

    Velocities are coded as what decoded positions leave of them where that is less; normals are
    not, since a later one may be out of reach.

    Parameters
    ----------
    name, first, bound, mesh
        As of `coded_track`.
    positions : callable or None
        Gives the positions of the first block, decoded, as they go out; None: nothing is predicted.

    Raises
    ------
    InvalidInputError
        If the bound cannot be guaranteed.
    """
    if bound == EXACT:
        return exact_coder(name, first, mesh)
    piece = slice(0, first.shape[0])
    coder = track_coder(name, first, bound, mesh, value_range(first))
    step, coded = StepSearch(coder, first, [piece]).best()
    if positions is not None and _is_velocity(first):
        decoded, fit = positions(), DifferenceFit()
        given = decoded if mesh.keeps_vertex_order else decoded[:, inverse_permutation(mesh.order)]
        fit.add(first.read(piece.start, piece.stop), given)
        way = fit.best()
        if way is not None:
            predicted = coder.predicted(*way, moving_surface(mesh), bound)
            finer, left = StepSearch(predicted, first, [piece], lambda *_: decoded).best()
            if left.size_bytes < coded.size_bytes:
                return predicted.with_step(finer)
    return coder.with_step(step)


def live_tracks(
    mesh: CodedMesh,
    first: Mapping[str, TrackSource],
    targets: TrackTargets | None,
    positions: Callable[[], Vertices] | None,
) -> dict[str, TrackCoder | ExactTrackCoder]:
    """The coders of the tracks that are kept, by their names; raises as `live_track`."""
    bounds = kept_bounds(mesh.config, first, targets)
    return {
        name: live_track(name, first[name], bound, mesh, positions)
        for name, bound in bounds.items()
    }


class StepSearch:
    """Looks for the step that takes the fewest bytes of a track, corrections included.

    Parameters
    ----------
    coder : TrackCoder
    track : TrackSource
    pieces : sequence of slice
        Frames of each block.
    decoded : callable, optional
        Gives decoded positions of a range of frames, as they go out, where the coder needs them.
    """

    def __init__(
        self,
        coder: TrackCoder,
        track: TrackSource,
        pieces: Sequence[slice],
        decoded: Callable[[int, int], Vertices] | None = None,
    ) -> None:
        self._coder, self._track, self._pieces, self._decoded = coder, track, pieces, decoded
        self._sizes: dict[float, float] = {}
        self._smallest: list[Sections] = []

    def best(
        self, n_trials: int = MOST_TRIALS, start: float | None = None
    ) -> tuple[float, CodedTrack]:
        """The best of so many steps, and the track coded with it; those tried before count.

        The first is `start`, in diagonals of the range. Default: a share of the bound.
        """
        first = self._coder.share / STEPS_OF_BOUND if start is None else start
        step = least_cost(self._size_bytes, first, n_trials=n_trials)
        return step, CodedTrack(self._coder.leading_section(), self._smallest)

    def _size_bytes(self, step: float) -> float:
        if step not in self._sizes:
            tried = self._coder.with_step(step)
            blocks = [tried.coded(one) for one in self._blocks()]
            size = float(sum(len(payload) for block in blocks for _, payload in block))
            if size < min(self._sizes.values(), default=math.inf):
                self._smallest = blocks
            self._sizes[step] = size
        return self._sizes[step]

    def _blocks(self) -> Iterable[PreparedValues]:
        """The blocks, ready to be coded; one that is all is kept."""
        return [self._only] if len(self._pieces) == 1 else map(self._prepared, self._pieces)

    @cached_property
    def _only(self) -> PreparedValues:
        return self._prepared(self._pieces[0])

    def _prepared(self, piece: slice) -> PreparedValues:
        frames = piece.start, piece.stop
        positions = None if self._decoded is None else self._decoded(*frames)
        return self._coder.prepared(self._track.read(*frames), positions)


def coded_exactly(
    coder: ExactTrackCoder,
    track: TrackSource,
    pieces: Sequence[slice],
    decoded: Callable[[int, int], Vertices] | None = None,
) -> CodedTrack:
    """A track whose values come back as they are; parameters as of `StepSearch`."""
    blocks = []
    for piece in pieces:
        positions = None if decoded is None else decoded(piece.start, piece.stop)
        blocks.append(coder.code(track.read(piece.start, piece.stop), positions))
    return CodedTrack(coder.leading_section(), blocks)
