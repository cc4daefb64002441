"""The study that compares our codec with Draco on sequences whose faces change."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from meshreel.evaluation.codecs.measure import DEFAULT_METHODS, method_sweep
from meshreel.evaluation.codecs.peers.draco import Draco
from meshreel.evaluation.codecs.peers.protocol import Peer, is_available, peers_named, why_missing
from meshreel.evaluation.pipeline import Measured, Subject
from meshreel.evaluation.plots import draw_envelopes
from meshreel.evaluation.runs.store import Result, Run
from meshreel.evaluation.surfaces.document import SurfaceResults, surface_document
from meshreel.evaluation.surfaces.measure import (
    MAX_COMPARED,
    MAX_COMPARED_QUICK,
    draco_run,
    our_run,
)
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.documents import Document, Picture
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.runtime.progress import Progress

METHOD = "reel"
"""The only method that encodes segments at a choice of rates."""

CAPTION = (
    "All bits without the order. A point is a stream; a line connects the Pareto-optimal points of "
    "a codec."
)


@dataclass(frozen=True)
class SurfaceStudy:
    """Compare our codec with Draco by the distances between surfaces.

    Attributes
    ----------
    methods : sequence of str
        The report lists those that need constant connectivity.
    peers : sequence of Peer
        The report lists those that need it, or whose package is missing.
    quick : bool
        Use few settings, and compare few frames.
    """

    methods: Sequence[str] = DEFAULT_METHODS
    peers: Sequence[Peer] = field(default_factory=peers_named)
    quick: bool = False
    program: str = "meshreel evaluate"

    def plan(self, sequence: MeshSequence) -> dict[str, list[Run]]:
        """The runs of all settings on positions and faces, ours first."""
        segments = [
            MeshSequence(one.read(0, one.n_frames), one.faces, one.fps) for one in sequence.segments
        ]
        whole = MeshSequence.of_segments(segments, sequence.name, sequence.start_s)
        n_compared = MAX_COMPARED_QUICK if self.quick else MAX_COMPARED
        sizes = whole.n_frames, max(one.n_verts for one in whole.segments)
        settings = method_sweep(METHOD, *sizes, quick=self.quick)
        runs = [our_run(whole, setting, n_compared) for setting in settings]
        runs = runs if METHOD in self.methods else []
        runs += [
            draco_run(whole, peer, bits, n_compared)
            for peer in self._available()
            if isinstance(peer, Draco)
            for bits in peer.sweep(quick=self.quick)
        ]
        return {"measured": runs}

    def collect(
        self, subject: Subject, groups: Mapping[str, list[Result]], progress: Progress
    ) -> SurfaceResults:
        """The results of all runs."""
        return SurfaceResults(subject.slug, subject.store.sequence, groups["measured"])

    def drawings(
        self, subject: Subject, results: SurfaceResults, folder: Path
    ) -> Iterator[Callable[[], Picture]]:
        """A function that draws the plot of rate and distance, if there are points."""
        if results.curves():
            yield partial(draw_curves, results, folder)

    def notes(self, measured: Measured[SurfaceResults]) -> dict[str, list[str]]:
        """Codecs that need the same faces in every frame, and missing packages."""
        others = [name for name in self.methods if name != METHOD]
        others += [peer.name for peer in self.peers if not isinstance(peer, Draco)]
        notes = [
            why_missing(peer)
            for peer in self.peers
            if isinstance(peer, Draco) and not is_available(peer)
        ]
        if others:
            names = ", ".join(f"`{name}`" for name in others)
            notes.append(f"codecs that need the same faces in every frame: {names}")
        return {"not_measured": notes}

    def document(self, measured: Measured[SurfaceResults], command: str) -> Document:
        """The report: plot and tables of each sequence, and the methodology."""
        notes = self.notes(measured)["not_measured"]
        return surface_document(measured, self._available(), notes, command)

    def _available(self) -> list[Peer]:
        return [peer for peer in self.peers if isinstance(peer, Draco) and is_available(peer)]


def draw_curves(results: SurfaceResults, folder: Path) -> Picture:
    """Draw rate and RMS distance of all codecs."""
    figure = blank_figure(9.5, 5.6)
    axes = figure.add_subplot()
    draw_envelopes(axes, results.curves(), "RMS distance (% of the diagonal)", "kilobits per frame")
    path = folder / f"{results.slug}-distance.png"
    save_figure(figure, path, overwrite=True)
    return Picture(path, f"Rate and distance between surfaces, {results.name}", CAPTION, 1)
