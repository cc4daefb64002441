"""Encoding of tracks, each within its bound."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache

from meshreel.arrays import Vertices
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.method_names import LOSSLESS
from meshreel.codec.methods import LiveStart, UnreachableError
from meshreel.codec.reel.encoding.shared_corners import SharedTrack, shared_track
from meshreel.codec.reel.encoding.step_search import (
    FEW_VALUES,
    DecodedPositions,
    StepSearch,
    numbers_of,
)
from meshreel.codec.reel.encoding.track_coders import (
    ExactTrackCoder,
    TrackCoder,
    track_coder,
)
from meshreel.codec.reel.encoding.track_residuals import DifferenceFit, moving_surface
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.source import CodedMesh, CodedTrack, Source
from meshreel.codec.targets import TargetKind
from meshreel.codec.track_bounds import EXACT, TrackBound, kept_bounds
from meshreel.codec.tracks import Coding, Sharing
from meshreel.model.surface import Domain
from meshreel.model.tracks import KIND_ROWS, TrackSource
from meshreel.runtime.progress import Count, Progress

RAW_RATIO = 8
"""A track compressed less than this many times is also tried losslessly."""

ROUNDING_RESERVE = 1 / 64
"""Share of the bound of predicted live values that is reserved for their rounding."""

MAX_ROWS_SHARE = 0.1
"""If the sharing of corners takes more than this share of the bytes of values, separate values of
corners are tried too."""


def encode_tracks(source: Source, progress: Progress) -> list[CodedTrack]:
    """Encode the tracks of a sequence, each within its bound.

    Those within a bound are encoded once, unless their size decides that of the positions;
    `FollowingTracks` searches for their steps and weights.

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
        config = source.config
        assert isinstance(config, ReelOptions)  # the options of this method
        has_size = config.target.kind is TargetKind.SIZE
        n_trials = None if has_size and prediction is None else 1
        coded = encode_track(name, track, bound, source, n_trials)
        is_exact = prediction is None and bound == EXACT
        tracks.append(coded if is_exact else replace(coded, prediction=prediction, values=track))
    return tracks


def _with_shared_values(
    name: str, track: TrackSource, bound: TrackBound, source: Source
) -> TrackSource:
    """Return the track of the values that corners share, if it takes fewer bytes than the track."""

    def values_bytes(candidate: TrackSource) -> int:
        return encode_track(name, candidate, bound, source, 1).size_bytes

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
    source: Source,
    n_trials: int | None = None,
) -> CodedTrack:
    """Encode a track with the step that takes the fewest bytes, including corrections.

    Parameters
    ----------
    n_trials : int, optional
        As of `StepSearch.best`.

    Raises
    ------
    InvalidInputError
        If the bound cannot be guaranteed.
    """
    mesh, pieces = source.mesh, source.pieces
    coder = track_coder(name, track, bound, mesh)
    if isinstance(coder, ExactTrackCoder):
        return encode_losslessly(coder, track, pieces)
    _, lossy = StepSearch(coder, track, pieces).best(n_trials)
    is_compact = lossy.size_bytes * RAW_RATIO < math.prod(track.shape) * track.dtype.itemsize
    if is_compact and len(numbers_of(track)) > FEW_VALUES:
        return lossy
    exact = encode_losslessly(coder.as_exact, track, pieces)
    return min(lossy, exact, key=lambda coded: coded.size_bytes)


def _prediction(
    source: Source, track: TrackSource, bound: TrackBound
) -> tuple[Coding, float] | None:
    """Return the coding of a track as residuals relative to positions, and its rate, if any.

    Only lossless positions predict lossless values; cells have no normals.
    """
    has_normals = KIND_ROWS[track.kind].follows == "normals" and track.domain is not Domain.CELL
    if has_normals and bound != EXACT:
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
    decoded: DecodedPositions | None,
) -> TrackCoder | ExactTrackCoder:
    """Return the coder of a track with the best step for its first block.

    Velocities are predicted from decoded positions if that takes fewer bytes; normals are not,
    because later ones may be unreachable.

    Parameters
    ----------
    name, first, bound, mesh
        As in `encode_track`; only the first block is known.
    decoded : DecodedPositions or None
        Positions of the first block; None disables prediction.

    Raises
    ------
    InvalidInputError
        If the bound cannot be guaranteed.
    """
    coder = track_coder(name, first, bound, mesh)
    if isinstance(coder, ExactTrackCoder):
        return coder
    piece = slice(0, first.shape[0])
    search = StepSearch(coder, first, [piece], decoded)
    _, coded = search.best()
    if decoded is not None and _is_velocity(first):
        fit = DifferenceFit()
        in_given_order = decoded(piece.start, piece.stop)
        if not mesh.keeps_vertex_order:
            in_given_order = in_given_order[:, inverse_permutation(mesh.order)]
        fit.add(first.read(piece.start, piece.stop), in_given_order)
        prediction = fit.best()
        if prediction is not None:
            # Later values may be larger, and are rounded more.
            reserve = max(coder.rounding, ROUNDING_RESERVE * coder.share * coder.header.scale)
            live = replace(coder, rounding=reserve)
            predicted = live.with_prediction(*prediction, moving_surface(mesh), bound)
            of_residuals = StepSearch(predicted, first, [piece], decoded)
            with suppress(UnreachableError):
                if of_residuals.best()[1].size_bytes < coded.size_bytes:
                    return of_residuals.coder
    return search.coder


def live_track_coders(
    start: LiveStart, positions: Callable[[], Vertices] | None
) -> dict[str, TrackCoder | ExactTrackCoder]:
    """Return the coders of tracks that are not dropped, by name; raises as `live_track_coder`."""
    bounds = kept_bounds(start.mesh.config, start.tracks, start.targets)
    decoded = None
    if positions is not None:
        first = cache(positions)  # decoded only if a track needs them, and once for all
        decoded = DecodedPositions(lambda begin, end: first()[begin:end])
    return {
        name: live_track_coder(name, start.tracks[name], bound, start.mesh, decoded)
        for name, bound in bounds.items()
    }


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
