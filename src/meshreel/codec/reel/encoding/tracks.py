"""Encoding of tracks, with a search for their quantization steps."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from meshreel.arrays import Vertices
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.method_names import LOSSLESS
from meshreel.codec.methods import LiveStart
from meshreel.codec.reel.encoding.effort import STEPS_OF_BOUND
from meshreel.codec.reel.encoding.rate_control import estimated_bytes, least_cost, sampled
from meshreel.codec.reel.encoding.shared_corners import SharedTrack, shared_track
from meshreel.codec.reel.encoding.track_coders import (
    ExactTrackCoder,
    PreparedValues,
    Sections,
    TrackCoder,
    exact_coder,
    track_coder,
)
from meshreel.codec.reel.encoding.track_residuals import DifferenceFit, moving_surface
from meshreel.codec.source import CodedMesh, CodedTrack, Source
from meshreel.codec.track_bounds import EXACT, TrackBound, kept_bounds
from meshreel.codec.tracks import Coding, Sharing
from meshreel.model.surface import Domain
from meshreel.model.tracks import KIND_ROWS, TrackSource, value_range
from meshreel.runtime.progress import Count, Progress

RAW_RATIO = 8
"""A track compressed less than this many times is also tried losslessly."""

FEW_VALUES = 16
"""A track with at most this many different numbers in a frame is also tried losslessly."""

MAX_TRIALS = 6
"""Maximum number of steps tried per track."""

MAX_ROWS_SHARE = 0.1
"""If the sharing of corners takes more than this share of the bytes of values, separate values of
corners are tried too."""


def encode_tracks(source: Source, progress: Progress) -> list[CodedTrack]:
    """Encode the tracks of a sequence, each within its bound.

    Tracks that positions may predict are encoded once; `FollowingTracks` searches for their steps.

    Raises
    ------
    InvalidInputError
        If a bound cannot be guaranteed.
    """
    tracks = []
    for number, (name, bound) in enumerate(source.bounds.items()):
        progress("encoding tracks", Count(number, len(source.bounds), "tracks"))
        track = _with_shared_values(name, source.sequence.tracks[name], bound, source)
        prediction = _prediction(source, track, bound)
        n_trials = MAX_TRIALS if prediction is None else 1
        coded = encode_track(name, track, bound, source.mesh, source.pieces, n_trials)
        if prediction is not None:
            coded = replace(coded, prediction=prediction, values=track)
        tracks.append(coded)
    return tracks


def _with_shared_values(
    name: str, track: TrackSource, bound: TrackBound, source: Source
) -> TrackSource:
    """Return the track of the values that corners share, if it takes fewer bytes than the track."""

    def values_bytes(candidate: TrackSource) -> int:
        return encode_track(name, candidate, bound, source.mesh, source.pieces, 1).size_bytes

    shared = shared_track(track, source.mesh)
    if shared is None or shared.sharing is Sharing.VERTICES:
        return shared or track
    size_bytes = values_bytes(shared)
    if len(shared.rows) <= MAX_ROWS_SHARE * size_bytes:
        return shared
    return shared if len(shared.rows) + size_bytes < values_bytes(track) else track


def encode_track(
    name: str,
    track: TrackSource,
    bound: TrackBound,
    mesh: CodedMesh,
    pieces: Sequence[slice],
    n_trials: int,
) -> CodedTrack:
    """Encode a track with the step that takes the fewest bytes, including corrections.

    Parameters
    ----------
    pieces : sequence of slice
        Frames of each block.
    n_trials : int
        Number of steps to try.

    Raises
    ------
    InvalidInputError
        If the bound cannot be guaranteed.
    """
    if bound == EXACT:
        return encode_losslessly(exact_coder(name, track, mesh), track, pieces)
    coder = track_coder(name, track, bound, mesh, value_range(track))
    _, lossy = StepSearch(coder, track, pieces).best(n_trials)
    is_compact = lossy.size_bytes * RAW_RATIO < math.prod(track.shape) * track.dtype.itemsize
    if is_compact and not _has_few_values(track):
        return lossy
    exact = encode_losslessly(coder.as_exact, track, pieces)
    return min(lossy, exact, key=lambda coded: coded.size_bytes)


def _has_few_values(track: TrackSource) -> bool:
    middle = track.shape[0] // 2
    return len(np.unique(track.read(middle, middle + 1))) <= FEW_VALUES


def _prediction(
    source: Source, track: TrackSource, bound: TrackBound
) -> tuple[Coding, float] | None:
    """Return the coding of a track as residuals relative to positions, and its rate, if any.

    Only lossless positions predict lossless values.
    """
    if KIND_ROWS[track.kind].follows == "normals" and bound != EXACT:
        return Coding.ROTATIONS, 0.0
    if not _is_velocity(track):
        return None
    if bound == EXACT and not (source.config.method == LOSSLESS and track.dtype.kind == "f"):
        return None
    fit = DifferenceFit()
    for piece in source.pieces:
        fit.add(track.read(piece.start, piece.stop), source.read(piece))
    return fit.best(source.sequence.timing.fps)


def _is_velocity(track: TrackSource) -> bool:
    """Whether a track contains velocities of vertices, which positions may predict."""
    is_of_vertices = track.domain is Domain.VERTEX
    if isinstance(track, SharedTrack):
        is_of_vertices = track.sharing is Sharing.VERTICES
    return KIND_ROWS[track.kind].follows == "motion" and is_of_vertices


def live_track_coder(
    name: str,
    first: TrackSource,
    bound: TrackBound,
    mesh: CodedMesh,
    positions: Callable[[], Vertices] | None,
) -> TrackCoder | ExactTrackCoder:
    """Return the coder of a track with the best step for its first block.

    Velocities are predicted from decoded positions if that takes fewer bytes; normals are not,
    because later ones may be unreachable.

    Parameters
    ----------
    name, first, bound, mesh
        As in `encode_track`; only the first block is known.
    positions : callable or None
        Decodes the positions of the first block, in output order; None disables prediction.

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
        in_given_order = decoded
        if not mesh.keeps_vertex_order:
            in_given_order = decoded[:, inverse_permutation(mesh.order)]
        fit.add(first.read(piece.start, piece.stop), in_given_order)
        prediction = fit.best()
        if prediction is not None:
            predicted = coder.with_prediction(*prediction, moving_surface(mesh), bound)
            predicted_step, residual = StepSearch(
                predicted, first, [piece], lambda *_: decoded
            ).best()
            if residual.size_bytes < coded.size_bytes:
                return predicted.with_step(predicted_step)
    return coder.with_step(step)


def live_track_coders(
    start: LiveStart, positions: Callable[[], Vertices] | None
) -> dict[str, TrackCoder | ExactTrackCoder]:
    """Return the coders of tracks that are not dropped, by name; raises as `live_track_coder`."""
    bounds = kept_bounds(start.mesh.config, start.tracks, start.targets)
    return {
        name: live_track_coder(name, start.tracks[name], bound, start.mesh, positions)
        for name, bound in bounds.items()
    }


class StepSearch:
    """Searches for the step with which a track takes the fewest bytes, including corrections.

    Steps of a long track are compared by a sample of its blocks.

    Parameters
    ----------
    pieces : sequence of slice
        Frames of each block.
    decoded : callable, optional
        Decodes positions of a range of frames, in output order, if the coder needs them.
    """

    def __init__(
        self,
        coder: TrackCoder,
        track: TrackSource,
        pieces: Sequence[slice],
        decoded: Callable[[int, int], Vertices] | None = None,
    ) -> None:
        self._coder, self._track, self._pieces, self._decoded = coder, track, pieces, decoded
        self._sampled = sampled(pieces)
        self._sizes: dict[float, float] = {}
        self._best: tuple[float, list[Sections]] | None = None

    def best(
        self, n_trials: int = MAX_TRIALS, start: float | None = None
    ) -> tuple[float, CodedTrack]:
        """Return the best of `n_trials` steps, or of earlier ones, and the track encoded with it.

        `start` is the first step, in diagonals of the range; it defaults to a share of the bound.
        """
        first = self._coder.share / STEPS_OF_BOUND if start is None else start
        step = least_cost(self._size_bytes, first, n_trials=n_trials)
        if self._best is None or self._best[0] != step:
            self._best = step, self._coded(step, self._pieces)
        return step, CodedTrack(self._coder.leading_section(), self._best[1])

    def _size_bytes(self, step: float) -> float:
        if step not in self._sizes:
            blocks = self._coded(step, self._sampled)
            sizes = [sum(len(payload) for _, payload in block) for block in blocks]
            size = estimated_bytes(sizes, len(self._pieces))
            if len(blocks) == len(self._pieces) and size < min(
                self._sizes.values(), default=math.inf
            ):
                self._best = step, blocks
            self._sizes[step] = size
        return self._sizes[step]

    def _coded(self, step: float, pieces: Sequence[slice]) -> list[Sections]:
        coder = self._coder.with_step(step)
        return [coder.code_prepared(prepared) for prepared in self._blocks(pieces)]

    def _blocks(self, pieces: Sequence[slice]) -> Iterable[PreparedValues]:
        """Return the prepared blocks of frames; a single one is cached."""
        return [self._single] if len(pieces) == 1 else map(self._prepare, pieces)

    @cached_property
    def _single(self) -> PreparedValues:
        return self._prepare(self._pieces[0])

    def _prepare(self, piece: slice) -> PreparedValues:
        frames = piece.start, piece.stop
        positions = None if self._decoded is None else self._decoded(*frames)
        return self._coder.prepare(self._track.read(*frames), positions)


def encode_losslessly(
    coder: ExactTrackCoder,
    track: TrackSource,
    pieces: Sequence[slice],
    decoded: Callable[[int, int], Vertices] | None = None,
) -> CodedTrack:
    """Encode a track losslessly; parameters as in `StepSearch`."""
    blocks = []
    for piece in pieces:
        positions = None if decoded is None else decoded(piece.start, piece.stop)
        blocks.append(coder.code(track.read(piece.start, piece.stop), positions))
    return CodedTrack(coder.leading_section(), blocks)
