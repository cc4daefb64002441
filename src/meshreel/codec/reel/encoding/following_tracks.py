"""Tracks that follow from positions: what decoded positions leave of velocities and normals."""

import math
from collections.abc import Iterable
from dataclasses import replace
from io import BytesIO

from meshreel.codec.achieved import measure_tracks
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.memory import OWN_STREAM, UNLIMITED
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.reel.encoding.shared_corners import SharedTrack
from meshreel.codec.reel.encoding.track_coders import exact_coder, track_coder
from meshreel.codec.reel.encoding.track_residuals import UnreachableError, moving_surface
from meshreel.codec.reel.encoding.tracks import MOST_TRIALS, StepSearch, block_ranges, coded_exactly
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.source import CodedTrack, Source
from meshreel.codec.track_bounds import EXACT
from meshreel.codec.tracks import Coding
from meshreel.errors import SolverError
from meshreel.model.tracks import TrackSource, value_range
from meshreel.runtime.progress import Count, Progress

CLEARLY_SMALLER = 1.15
"""Where one of two ways takes so many times the bytes of the other with the first step that is
tried, it is not tried with others."""

FEW_TRIALS = 3
"""Steps of a track that are tried to tell how much it takes beside positions of a step."""

LEAST_TO_SAVE = 0.25
"""Finer positions are tried where tracks that follow from them take more than this share of their
bytes: half the step costs positions about as much."""

SLACK = 1e-9
"""Share by which an error may seem larger than it is, by the rounding of the measure."""


class FollowingTracks:
    """Codes tracks as what decoded positions leave of them, where that takes fewer bytes.

    Parameters
    ----------
    source : Source
        Its tracks are those of `coded_tracks`.
    progress : callable
    """

    def __init__(self, source: Source, progress: Progress) -> None:
        self._source, self._progress = source, progress
        self._surface = moving_surface(source.mesh)
        self._steps: dict[str, float] = {}

    def stream(self, data: bytes) -> bytes:
        """A stream of the source with tracks that follow from its positions.

        Parameters
        ----------
        data : bytes
            A stream of the source; its positions stay as they are.

        Raises
        ------
        SolverError
            If a track is not within its bound.
        """
        source, tracks = self._source, self._coded(data, MOST_TRIALS)
        if tracks != source.tracks:
            source = replace(source, tracks=tracks)
            opened = whole_stream(data, UNLIMITED)
            promises = (one for one in opened.leading if one.id == Section.PROMISE)
            leading = [(Section.PROMISE, opened.payload(one)) for one in promises]
            blocks = (
                (opened.file.block(number).n_frames, opened.group(number))
                for number in range(opened.n_blocks)
            )
            data = source.stream(leading, blocks)
        _check_kept(source, data)
        return data

    def size_bytes(self, data: bytes) -> int:
        """About the bytes of `stream`; few steps of the tracks are tried."""
        coded = self._coded(data, FEW_TRIALS)
        return len(data) - _size_bytes(self._source.tracks) + _size_bytes(coded)

    def may_want_finer(self, data: bytes, size_bytes: int) -> bool:
        """Whether finer positions might save more bytes of tracks than they take.

        Parameters
        ----------
        data : bytes
            A stream of the source.
        size_bytes : int
            As of the method.
        """
        tracks = self._source.tracks
        positions = len(data) - _size_bytes(tracks)
        others = _size_bytes(one for one in tracks if one.prediction is None)
        return size_bytes - positions - others > LEAST_TO_SAVE * positions

    def _coded(self, data: bytes, n_trials: int) -> list[CodedTrack]:
        tracks, found = list(self._source.tracks), []
        with ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
            for number, (coded, name) in enumerate(zip(tracks, self._source.bounds, strict=True)):
                self._progress("predicting tracks", Count(number, len(tracks), "tracks"))
                smaller = coded
                if coded.prediction is not None and coded.values is not None:
                    following = self._following(
                        name, coded.values, coded, coded.prediction, reel, n_trials
                    )
                    smaller = min(coded, following, key=lambda one: one.size_bytes)
                found.append(replace(smaller, prediction=None, values=None))
        return found

    def _following(
        self,
        name: str,
        track: TrackSource,
        coded: CodedTrack,
        way: tuple[Coding, float],
        reel: ReelFile,
        n_trials: int,
    ) -> CodedTrack:
        source, mesh, pieces = self._source, self._source.mesh, block_ranges(self._source)
        bound, surface = source.bounds[name], self._surface
        if isinstance(track, SharedTrack):
            surface = replace(surface, vertex_of_row=track.vertex_of_row)
        if bound == EXACT:
            exact = exact_coder(name, track, mesh).predicted(*way, surface)
            return coded_exactly(exact, track, pieces, reel.read)
        coder = track_coder(name, track, bound, mesh, value_range(track))
        predicted = coder.predicted(*way, surface, bound)
        search, found = StepSearch(predicted, track, pieces, reel.read), [coded]
        start = self._steps.get(name)
        try:
            once: float = search.best(1, start)[1].size_bytes
        except UnreachableError:
            once = math.inf
        if once * CLEARLY_SMALLER > coded.size_bytes and n_trials == MOST_TRIALS:
            found.append(StepSearch(coder, track, pieces).best()[1])
        if once < CLEARLY_SMALLER * coded.size_bytes:
            self._steps[name], following = search.best(n_trials, start)
            found.append(following)
        return min(found, key=lambda one: one.size_bytes)


def _size_bytes(tracks: Iterable[CodedTrack]) -> int:
    return sum(one.size_bytes for one in tracks)


def _check_kept(source: Source, data: bytes) -> None:
    """Nothing if every track of a stream is within its bound.

    Raises
    ------
    SolverError
        If one is not.
    """
    measured = measure_tracks(source.sequence, data, order=source.config.order)
    for track in whole_stream(data).tracks:
        found = measured[track.name].largest
        if found > track.bound * (1.0 + SLACK):
            raise SolverError(
                f"track {track.name!r} decodes to errors of up to {found:g}, and {track.bound:g} "
                "was promised; nothing is written; please report this sequence"
            )
