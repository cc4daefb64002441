"""A track as a study: our codec and compressors of arrays at equal largest error."""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from meshreel.evaluation.codecs.peers.protocol import is_available, why_missing
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.pipeline import Measured as MeasuredResults
from meshreel.evaluation.pipeline import Subject
from meshreel.evaluation.plots.axes import draw_envelopes
from meshreel.evaluation.runs.run import Run
from meshreel.evaluation.runs.store import Result
from meshreel.evaluation.tracks.document import track_document
from meshreel.evaluation.tracks.measure import Measured, our_run, peer_run
from meshreel.evaluation.tracks.peers import TRACK_PEERS, TrackPeer
from meshreel.evaluation.tracks.results import TrackResults
from meshreel.evaluation.tracks.settings import Level, levels_of
from meshreel.metrics.track_errors import error_unit
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track, describe_track, track_by_name
from meshreel.rendering.documents.parts import Document, Picture
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.runtime.progress import Progress

CAPTION = (
    "Bits of the track alone by its numbers. A point is a stream; a line joins those that no other "
    "of its codec beats. Streams that lose nothing have no place on a log axis of errors."
)


@dataclass(frozen=True)
class TrackStudy:
    """One track of any sequences, beside compressors of arrays.

    Attributes
    ----------
    track : str
        Its name, the same in all sequences.
    peers : sequence of TrackPeer
        Those whose package is missing are named in the report.
    quick : bool
        Few bounds.
    """

    track: str
    peers: Sequence[TrackPeer] = TRACK_PEERS
    quick: bool = False
    program: str = "meshreel evaluate"

    def plan(self, sequence: MeshSequence) -> dict[str, list[Run]]:
        """The runs at all bounds, ours first.

        Raises
        ------
        InvalidInputError
            If the sequence has no such track.
        """
        measured = Measured(with_track_alone(sequence, self.track), self.track)
        levels = levels_of(measured.track, quick=self.quick)
        return {"measured": self.runs(measured, levels)}

    def runs(self, measured: Measured, levels: Sequence[Level]) -> list[Run]:
        """The runs of ours at all levels, then those of the peers that are there."""
        identity = _identity(self.track, measured.track)
        runs = [our_run(measured, level, identity) for level in levels]
        return runs + [
            peer_run(measured, peer, level, identity)
            for peer in self._available()
            for level in levels
        ]

    def collect(
        self, subject: Subject, found: Mapping[str, list[Result]], progress: Progress
    ) -> TrackResults:
        """The results of all runs."""
        track = subject.sequence.tracks[self.track]
        about = {
            **_identity(self.track, track),
            "described": describe_track(track),
            "shape": list(track.shape),
            "error_unit": error_unit(track),
            "raw_bytes": track.values.nbytes,
        }
        return TrackResults(subject.slug, subject.store.sequence, about, found["measured"])

    def drawings(
        self, subject: Subject, results: TrackResults, folder: Path
    ) -> Iterator[Callable[[], Picture]]:
        """A function for the plot of rate against largest error."""
        return drawings(results, folder)

    def notes(self, measured: MeasuredResults[TrackResults]) -> dict[str, list[str]]:
        """Packages that are missing."""
        there = self._available()
        return {"not_measured": [why_missing(peer) for peer in self.peers if peer not in there]}

    def document(self, measured: MeasuredResults[TrackResults], command: str) -> Document:
        """The report: plot and tables of each sequence, and how it was measured."""
        notes = self.notes(measured)["not_measured"]
        return track_document(measured, self._available(), notes, command)

    def _available(self) -> list[TrackPeer]:
        return [peer for peer in self.peers if is_available(peer)]


def with_track_alone(sequence: MeshSequence, name: str) -> MeshSequence:
    """A sequence without its other tracks.

    Raises
    ------
    InvalidInputError
        If it has no such track.
    """
    return replace(sequence, tracks={name: track_by_name(sequence.tracks, name)})


def _identity(name: str, track: Track) -> dict[str, Any]:
    """Name and a hash of the values."""
    digest = hashlib.sha256(f"{describe_track(track)} {track.shape}".encode())
    digest.update(track.values.tobytes())
    return {"name": name, "sha256": digest.hexdigest()}


def drawings(results: TrackResults, folder: Path) -> Iterator[Callable[[], Picture]]:
    """A function for the plot, if there are points."""
    if results.curves():
        yield partial(draw_curves, results, folder)


def draw_curves(results: TrackResults, folder: Path) -> Picture:
    """The plot of all codecs."""
    unit = results.track["error_unit"]
    figure = blank_figure(9.5, 5.6)
    draw_envelopes(
        figure.add_subplot(),
        results.curves(),
        f"largest error of {results.track['name']}" + (f", {unit}" if unit else ""),
        "bits per number",
    )
    path = folder / f"{results.slug}-{file_name(results.track['name'])}.png"
    save_figure(figure, path, overwrite=True)
    return Picture(path, f"Rate and largest error, {results.name}", CAPTION, 1)
