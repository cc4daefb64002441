"""Velocities and normals coded as residuals of predictions from decoded positions."""

import math
from collections.abc import Iterable
from dataclasses import replace
from io import BytesIO

from meshreel.codec.bitstream.layout import Section
from meshreel.codec.memory import OWN_STREAM, UNLIMITED
from meshreel.codec.methods import UnreachableError
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.reel.encoding.shared_corners import SharedTrack
from meshreel.codec.reel.encoding.step_search import (
    DecodedPositions,
    RelatedTrack,
    StepSearch,
)
from meshreel.codec.reel.encoding.track_coders import (
    ExactTrackCoder,
    exact_coder,
    track_coder,
)
from meshreel.codec.reel.encoding.track_residuals import moving_surface
from meshreel.codec.reel.encoding.tracks import encode_losslessly
from meshreel.codec.reel_file import ReelFile
from meshreel.codec.source import CodedTrack, Source
from meshreel.codec.track_bounds import EXACT
from meshreel.codec.tracks import Coding
from meshreel.model.tracks import TrackSource
from meshreel.runtime.progress import Count, Progress

CLEAR_RATIO = 1.15
"""An alternative that is this many times larger at its first step is abandoned."""

MIN_NUMBERS = 8
"""Fields of several blocks are kept for later tracks if these have this many numbers per item."""

FEW_TRIALS = 3
"""Number of steps tried to estimate the size of a track."""

MIN_TRACK_SHARE = 0.25
"""Finer positions are tried if predicted tracks take more than this share of the bytes of
positions, about the cost of halving the step."""


class FollowingTracks:
    """Predicts tracks from decoded positions, if that takes fewer bytes.

    Parameters
    ----------
    source : Source
        Its tracks are from `encode_tracks`.
    """

    def __init__(self, source: Source, progress: Progress) -> None:
        self._source, self._progress = source, progress
        self._surface = moving_surface(source.mesh)
        self._steps: dict[str, float] = {}

    def stream(self, data: bytes) -> bytes:
        """Return the stream with its tracks predicted, if that is smaller; positions stay."""
        source, tracks = self._source, self._encoded(data, None)
        if tracks == source.tracks:
            return data
        opened = whole_stream(data, UNLIMITED)
        bounds = (section for section in opened.file.leading if section.id == Section.ERROR_BOUND)
        leading = [(Section.ERROR_BOUND, opened.payload(section)) for section in bounds]
        blocks = (
            (opened.file.block(number).n_frames, opened.group(number))
            for number in range(opened.n_blocks)
        )
        # Smaller payloads may have more sections, and a compact stream may exceed its limit.
        return min(source.with_changes(tracks=tracks).stream(leading, blocks), data, key=len)

    def size_bytes(self, data: bytes) -> int:
        """Estimate the bytes of `stream`, with few trials per track."""
        tracks = self._encoded(data, FEW_TRIALS)
        return len(data) - _size_bytes(self._source.tracks) + _size_bytes(tracks)

    def may_gain_from_finer(self, data: bytes, size_bytes: int) -> bool:
        """Return whether finer positions might save more bytes of tracks than they cost.

        `size_bytes` is the estimate for the stream.
        """
        tracks = self._source.tracks
        positions = len(data) - _size_bytes(tracks)
        others = _size_bytes(track for track in tracks if track.prediction is None)
        return size_bytes - positions - others > MIN_TRACK_SHARE * positions

    def _encoded(self, data: bytes, n_trials: int | None) -> list[CodedTrack]:
        tracks, results = list(self._source.tracks), []
        self._related: list[RelatedTrack] = []
        with ReelFile(BytesIO(data), memory=OWN_STREAM) as reel:
            decoded = DecodedPositions(reel.read)
            for number, (coded, name) in enumerate(zip(tracks, self._source.bounds, strict=True)):
                self._progress("predicting tracks", Count(number, len(tracks), "tracks"))
                smaller = coded
                if coded.prediction is not None and coded.values is not None:
                    predicted = self._predicted(
                        name, coded.values, coded, coded.prediction, decoded, n_trials
                    )
                    smaller = min(coded, predicted, key=_size_of)
                elif coded.values is not None and n_trials is None:
                    smaller = self._searched(name, coded.values, coded, decoded, number)
                results.append(replace(smaller, prediction=None, values=None))
        return results

    def _predicted(
        self,
        name: str,
        track: TrackSource,
        coded: CodedTrack,
        prediction: tuple[Coding, float],
        decoded: DecodedPositions,
        n_trials: int | None,
    ) -> CodedTrack:
        source, mesh, pieces = self._source, self._source.mesh, self._source.pieces
        bound, surface = source.bounds[name], self._surface
        if isinstance(track, SharedTrack):
            surface = replace(surface, vertex_of_row=track.vertex_of_row)
        if bound == EXACT:
            exact = exact_coder(name, track, mesh).with_prediction(*prediction, surface)
            return encode_losslessly(exact, track, pieces, decoded)
        coder = track_coder(name, track, bound, mesh)
        if isinstance(coder, ExactTrackCoder):
            return coded
        predicted = coder.with_prediction(*prediction, surface, bound)
        search, results = StepSearch(predicted, track, pieces, decoded), [coded]
        start = self._steps.get(name)
        try:
            first_bytes: float = search.best(1, start)[1].size_bytes
        except UnreachableError:
            first_bytes = math.inf
        if first_bytes * CLEAR_RATIO > coded.size_bytes and n_trials is None:
            results.append(StepSearch(coder, track, pieces, decoded).best()[1])
        if first_bytes < CLEAR_RATIO * coded.size_bytes:
            self._steps[name], best = search.best(n_trials, start)
            results.append(best)
        return min(results, key=_size_of)

    def _searched(
        self,
        name: str,
        track: TrackSource,
        coded: CodedTrack,
        decoded: DecodedPositions,
        number: int,
    ) -> CodedTrack:
        """Encode a track with its best step, predicted from positions and tracks if that helps."""
        coder = track_coder(name, track, self._source.bounds[name], self._source.mesh)
        if isinstance(coder, ExactTrackCoder):
            return coded
        # Fields are kept for later tracks of the same items if they take little memory.
        source, pieces = self._source, self._source.pieces
        later = (source.sequence.tracks[name] for name in list(source.bounds)[number + 1 :])
        n_numbers = source.n_frames * track.shape[2] / len(pieces)
        is_followed = any(other.domain is track.domain for other in later)
        is_followed = is_followed and (len(pieces) == 1 or n_numbers >= MIN_NUMBERS)
        relation = decoded, number, self._related
        search = StepSearch(coder, track, pieces, *relation, keeps_fields=is_followed)
        smaller = min(search.best()[1], coded, key=_size_of)
        if is_followed and smaller is not coded:
            self._related.append(search.as_related)
        return smaller


def _size_of(track: CodedTrack) -> int:
    return track.size_bytes


def _size_bytes(tracks: Iterable[CodedTrack]) -> int:
    return sum(track.size_bytes for track in tracks)
