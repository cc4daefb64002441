"""The study that compares a track in our codec with array compressors."""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from meshreel.evaluation.codecs.peers.protocol import is_available, why_missing
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.pipeline import Measured, Subject
from meshreel.evaluation.plots import draw_envelopes
from meshreel.evaluation.runs.store import Result, Run
from meshreel.evaluation.tracks.document import track_document
from meshreel.evaluation.tracks.measure import Level, TrackInput, levels_of, our_run, peer_run
from meshreel.evaluation.tracks.peers import TRACK_PEERS, TrackPeer
from meshreel.evaluation.tracks.results import TrackResults
from meshreel.metrics.track_errors import error_unit
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track, describe_track, track_by_name
from meshreel.rendering.documents import Document, Picture
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.runtime.progress import Progress

CAPTION = (
    "Bits of the track alone, per number. A point is a stream; a line connects the Pareto-optimal "
    "points of a codec. Lossless streams do not appear on a log axis of errors."
)


@dataclass(frozen=True)
class TrackStudy:
    """Compare one track of any sequences with array compressors.

    Attributes
    ----------
    track : str
        Its name, the same in all sequences.
    peers : sequence of TrackPeer
        The report lists those whose package is missing.
    quick : bool
        Use few bounds.
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
            If the sequence lacks the track.
        """
        track_input = TrackInput(with_track_alone(sequence, self.track), self.track)
        levels = levels_of(track_input.track, quick=self.quick)
        return {"measured": self.runs(track_input, levels)}

    def runs(self, track_input: TrackInput, levels: Sequence[Level]) -> list[Run]:
        """The runs of our codec at all levels, then those of the available peers."""
        identity = _identity(self.track, track_input.track)
        runs = [our_run(track_input, level, identity) for level in levels]
        return runs + [
            peer_run(track_input, peer, level, identity)
            for peer in self._available()
            for level in levels
        ]

    def collect(
        self, subject: Subject, groups: Mapping[str, list[Result]], progress: Progress
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
        return TrackResults(subject.slug, subject.store.sequence, about, groups["measured"])

    def drawings(
        self, subject: Subject, results: TrackResults, folder: Path
    ) -> Iterator[Callable[[], Picture]]:
        """A function that draws the plot of rate and largest error, if there are points."""
        if results.curves():
            yield partial(draw_curves, results, folder)

    def notes(self, measured: Measured[TrackResults]) -> dict[str, list[str]]:
        """Missing packages."""
        available = self._available()
        missing = [why_missing(peer) for peer in self.peers if peer not in available]
        return {"not_measured": missing}

    def document(self, measured: Measured[TrackResults], command: str) -> Document:
        """The report: plot and tables of each sequence, and the methodology."""
        notes = self.notes(measured)["not_measured"]
        return track_document(measured, self._available(), notes, command)

    def _available(self) -> list[TrackPeer]:
        return [peer for peer in self.peers if is_available(peer)]


def with_track_alone(sequence: MeshSequence, name: str) -> MeshSequence:
    """The sequence without its other tracks.

    Raises
    ------
    InvalidInputError
        If it lacks the track.
    """
    return sequence.replace(tracks={name: track_by_name(sequence.tracks, name)})


def _identity(name: str, track: Track) -> dict[str, Any]:
    """Name and a hash of the values."""
    digest = hashlib.sha256(f"{describe_track(track)} {track.shape}".encode())
    digest.update(track.values.tobytes())
    return {"name": name, "sha256": digest.hexdigest()}


def draw_curves(results: TrackResults, folder: Path) -> Picture:
    """Draw rate and largest error of all codecs."""
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
