"""Our codec beside others as a study: methods, peers and recorded points on any sequences."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from meshreel.evaluation.codecs.arrangements import Arrangements
from meshreel.evaluation.codecs.document import codec_document
from meshreel.evaluation.codecs.measure import method_run, peer_run
from meshreel.evaluation.codecs.peers.protocol import Peer, is_available, why_missing
from meshreel.evaluation.codecs.peers.registry import peers_named
from meshreel.evaluation.codecs.recorded import RecordedPoint, matching
from meshreel.evaluation.codecs.results import ERRORS, RECORDED, CodecResults, family
from meshreel.evaluation.codecs.settings import DEFAULT_METHODS, method_sweep
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.pipeline import Measured, Subject
from meshreel.evaluation.plots.axes import draw_envelopes
from meshreel.evaluation.rate_distortion import Point
from meshreel.evaluation.runs.run import Run
from meshreel.evaluation.runs.store import Result
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.documents.parts import Document, Picture
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.runtime.progress import Progress

TITLES = {
    "kg_error_percent": "Rate and KG error",
    "sted": "Rate and STED",
    "max_error_percent": "Rate and largest error",
}


@dataclass(frozen=True)
class CodecStudy:
    """Methods of ours and other codecs, on any sequences.

    Attributes
    ----------
    methods : sequence of str
        Of `settings.CODED_METHODS`.
    peers : sequence of Peer
        Those whose package is missing are named in the report.
    recorded : sequence of RecordedPoint
        Points of other sequences are passed over.
    quick : bool
        Few settings of each codec.
    """

    methods: Sequence[str] = DEFAULT_METHODS
    peers: Sequence[Peer] = field(default_factory=peers_named)
    recorded: Sequence[RecordedPoint] = ()
    quick: bool = False
    program: str = "meshreel evaluate"

    def plan(self, sequence: MeshSequence) -> dict[str, list[Run]]:
        """The runs of all settings, methods first."""
        arrangements = Arrangements(sequence)
        runs = [
            method_run(sequence, setting)
            for method in self.methods
            for setting in method_sweep(
                method, sequence.n_frames, sequence.n_verts, quick=self.quick
            )
        ]
        runs += [
            peer_run(arrangements, peer, value)
            for peer in self._available()
            for value in peer.sweep(quick=self.quick)
        ]
        return {"measured": runs}

    def collect(
        self, subject: Subject, found: Mapping[str, list[Result]], progress: Progress
    ) -> CodecResults:
        """The results of all runs, with the recorded points of the sequence."""
        sequence = subject.store.sequence
        return CodecResults(
            subject.slug, sequence, found["measured"], matching(self.recorded, sequence)
        )

    def drawings(
        self, subject: Subject, results: CodecResults, folder: Path
    ) -> Iterator[Callable[[], Picture]]:
        """A function for each plot of rate against an error."""
        return drawings(results, folder)

    def notes(self, measured: Measured[CodecResults]) -> dict[str, list[str]]:
        """Packages that are missing, and sequences of which no row is recorded."""
        there = self._available()
        missing = [why_missing(peer) for peer in self.peers if peer not in there]
        unrecorded = [
            _no_recorded(results.sequence)
            for results, _ in measured
            if self.recorded and not results.recorded
        ]
        return {"not_measured": missing + unrecorded}

    def document(self, measured: Measured[CodecResults], command: str) -> Document:
        """The report: plots and tables of each sequence, and how it was measured."""
        notes = self.notes(measured)["not_measured"]
        return codec_document(measured, self._available(), notes, command)

    def _available(self) -> list[Peer]:
        return [peer for peer in self.peers if is_available(peer)]


def _no_recorded(sequence: dict[str, Any]) -> str:
    return (
        f"no recorded row is of {sequence['name'] or 'a sequence without a name'} with "
        f"{sequence['n_verts']} vertices (n) and {sequence['n_frames']} frames (k)"
    )


def drawings(results: CodecResults, folder: Path) -> Iterator[Callable[[], Picture]]:
    """A function for each plot, of rate against an error that has points."""
    for error in ERRORS:
        curves = shown_curves(results.curves(error))
        if curves:
            yield partial(draw_curves, results, error, curves, folder)


def draw_curves(
    results: CodecResults, error: str, curves: Mapping[str, Sequence[Point]], folder: Path
) -> Picture:
    """The plot of curves of rate against this error."""
    figure = blank_figure(9.5, 5.6)
    draw_envelopes(figure.add_subplot(), curves, ERRORS[error])
    path = folder / f"{results.slug}-{file_name(error)}.png"
    save_figure(figure, path, overwrite=True)
    return Picture(path, f"{TITLES[error]}, {results.name}", _caption(curves), 1)


def shown_curves(curves: Mapping[str, Sequence[Point]]) -> dict[str, Sequence[Point]]:
    """The curves without those recorded ones whose codec was measured here."""
    measured = {family(label) for label in curves if not label.endswith(RECORDED)}
    return {
        label: points
        for label, points in curves.items()
        if not label.endswith(RECORDED) or family(label) not in measured
    }


def _caption(curves: Mapping[str, Sequence[Point]]) -> str:
    text = (
        "Rate of the whole with the order dropped. A point is a stream; a line joins those that no "
        "other of its codec beats. Lossless codecs have no place on a log axis of errors."
    )
    if any(label.endswith(RECORDED) for label in curves):
        text += (
            " Dashed: recorded elsewhere; those of codecs that were measured here are left out, "
            "and stand in the tables."
        )
    return text
