"""The study that compares our methods with other codecs on any sequences."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from meshreel.evaluation.codecs.document import codec_document
from meshreel.evaluation.codecs.measure import (
    DEFAULT_METHODS,
    Arrangements,
    method_run,
    method_sweep,
    peer_run,
)
from meshreel.evaluation.codecs.peers.protocol import Peer, is_available, peers_named, why_missing
from meshreel.evaluation.codecs.results import (
    ERRORS,
    RECORDED,
    CodecResults,
    RecordedPoint,
    family,
    matching,
)
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.pipeline import Measured, Subject
from meshreel.evaluation.plots import draw_envelopes
from meshreel.evaluation.rate_distortion import Point
from meshreel.evaluation.runs.store import Result, Run
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.documents import Document, Picture
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.runtime.progress import Progress

TITLES = {
    "kg_error_percent": "Rate and KG error",
    "sted": "Rate and STED",
    "max_error_percent": "Rate and largest error",
}


@dataclass(frozen=True)
class CodecStudy:
    """Compare our methods with other codecs and with points measured elsewhere.

    Attributes
    ----------
    methods : sequence of str
        From `settings.CODED_METHODS`.
    peers : sequence of Peer
        The report lists those whose package is missing.
    recorded : sequence of RecordedPoint
        Points of other sequences are ignored.
    quick : bool
        Use few settings of each codec.
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
        self, subject: Subject, groups: Mapping[str, list[Result]], progress: Progress
    ) -> CodecResults:
        """The results of all runs and the recorded points of the sequence."""
        sequence = subject.store.sequence
        return CodecResults(
            subject.slug, sequence, groups["measured"], matching(self.recorded, sequence)
        )

    def drawings(
        self, subject: Subject, results: CodecResults, folder: Path
    ) -> Iterator[Callable[[], Picture]]:
        """Functions that each draw a plot of rate and one error."""
        for error in ERRORS:
            curves = shown_curves(results.curves(error))
            if curves:
                yield partial(draw_curves, results, error, curves, folder)

    def notes(self, measured: Measured[CodecResults]) -> dict[str, list[str]]:
        """Missing packages, and sequences without a recorded row."""
        available = self._available()
        missing = [why_missing(peer) for peer in self.peers if peer not in available]
        unrecorded = [
            f"no recorded row matches {results.sequence['name'] or 'a sequence without a name'} "
            f"with {results.sequence['n_verts']} vertices (n) and {results.sequence['n_frames']} "
            "frames (k)"
            for results, _ in measured
            if self.recorded and not results.recorded
        ]
        return {"not_measured": missing + unrecorded}

    def document(self, measured: Measured[CodecResults], command: str) -> Document:
        """The report: plots and tables of each sequence, and the methodology."""
        notes = self.notes(measured)["not_measured"]
        return codec_document(measured, self._available(), notes, command)

    def _available(self) -> list[Peer]:
        return [peer for peer in self.peers if is_available(peer)]


def draw_curves(
    results: CodecResults, error: str, curves: Mapping[str, Sequence[Point]], folder: Path
) -> Picture:
    """Draw the curves of rate and one error."""
    figure = blank_figure(9.5, 5.6)
    draw_envelopes(figure.add_subplot(), curves, ERRORS[error])
    path = folder / f"{results.slug}-{file_name(error)}.png"
    save_figure(figure, path, overwrite=True)
    return Picture(path, f"{TITLES[error]}, {results.name}", _caption(curves), 1)


def shown_curves(curves: Mapping[str, Sequence[Point]]) -> dict[str, Sequence[Point]]:
    """The curves without recorded ones of codecs that were measured here."""
    measured = {family(label) for label in curves if not label.endswith(RECORDED)}
    return {
        label: points
        for label, points in curves.items()
        if not label.endswith(RECORDED) or family(label) not in measured
    }


def _caption(curves: Mapping[str, Sequence[Point]]) -> str:
    text = (
        "Total rate without vertex order. A point is a stream; a line connects the Pareto-optimal "
        "points of a codec. Lossless codecs do not appear on a log axis of errors."
    )
    if any(label.endswith(RECORDED) for label in curves):
        text += (
            " Dashed: recorded elsewhere; recorded points of codecs that were measured here appear "
            "only in the tables."
        )
    return text
