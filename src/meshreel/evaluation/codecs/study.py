"""Our methods beside other codecs: sequences in, results, plots and report out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from meshreel.evaluation.codecs.arrangements import Subject
from meshreel.evaluation.codecs.document import write_codec_report
from meshreel.evaluation.codecs.measure import run_method, run_peer
from meshreel.evaluation.codecs.peers.protocol import Peer, is_available, why_missing
from meshreel.evaluation.codecs.peers.registry import PEERS
from meshreel.evaluation.codecs.plots import draw_codecs
from meshreel.evaluation.codecs.recorded import RecordedPoint, matching
from meshreel.evaluation.codecs.results import CodecResults
from meshreel.evaluation.codecs.settings import DEFAULT_METHODS, method_sweep
from meshreel.evaluation.folder import claim_folder, unique_names
from meshreel.evaluation.report.document import Picture
from meshreel.evaluation.runs.store import Result, Store
from meshreel.rendering.plots import require_matplotlib
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.sequence import MeshSequence

PROGRAM = "meshreel evaluate"


@dataclass(frozen=True)
class CodecEvaluation:
    """What `evaluate` wrote and measured.

    Attributes
    ----------
    markdown, html : Path
    measured : list of (CodecResults, list of Picture)
    notes : list of str
        What was asked for and could not be had.
    """

    markdown: Path
    html: Path
    measured: list[tuple[CodecResults, list[Picture]]]
    notes: list[str]

    def as_dict(self) -> dict[str, Any]:
        """Paths and all figures, in plain types."""
        return {
            "report": {"markdown": str(self.markdown), "html": str(self.html)},
            "not_measured": self.notes,
            "sequences": [
                {**results.as_dict(), "figures": [str(picture.path) for picture in pictures]}
                for results, pictures in self.measured
            ],
        }


def evaluate(
    sequences: Sequence[MeshSequence],
    out: Path,
    *,
    methods: Sequence[str] = DEFAULT_METHODS,
    peers: Sequence[Peer] = PEERS,
    recorded: Sequence[RecordedPoint] = (),
    quick: bool = False,
    command: str = PROGRAM,
    progress: Progress = silent,
) -> CodecEvaluation:
    """Measure methods and peers on the sequences, and write the report of them.

    Results that the folder has already are not computed again.

    Parameters
    ----------
    sequences : sequence of MeshSequence
    out : Path
        A new or an empty folder, or one that an earlier run made.
    methods : sequence of str
        Of `sweeps.CODED_METHODS`.
    peers : sequence of Peer
        Those whose package is missing are named in the report.
    recorded : sequence of RecordedPoint
        Points of other sequences are passed over.
    quick : bool
        Few settings of each codec.
    command : str
        The report says that it was made by it.

    Raises
    ------
    InvalidInputError
        If matplotlib is missing, or the folder holds something else.
    """
    require_matplotlib()
    claim_folder(out, PROGRAM, command)
    drawn = out / "figures"
    drawn.mkdir(exist_ok=True)
    there = [peer for peer in peers if is_available(peer)]
    notes = [why_missing(peer) for peer in peers if peer not in there]
    measured = []
    for sequence, slug in zip(sequences, unique_names(sequences), strict=True):
        store = Store.for_sequence(out / "results", sequence)
        runs = measure(sequence, slug, store, methods, there, quick=quick, progress=progress)
        results = CodecResults(slug, store.sequence, runs, matching(recorded, store.sequence))
        if recorded and not results.recorded:
            notes.append(_no_recorded(store.sequence))
        progress(f"{slug}: drawing", 0.0)
        measured.append((results, draw_codecs(results, drawn)))
    progress("writing the report", 0.0)
    markdown, html = write_codec_report(measured, there, notes, out, command)
    return CodecEvaluation(markdown, html, measured, notes)


def measure(
    sequence: MeshSequence,
    slug: str,
    store: Store,
    methods: Sequence[str],
    peers: Sequence[Peer],
    *,
    quick: bool = False,
    progress: Progress = silent,
) -> list[Result]:
    """The results of all settings of one sequence, methods first."""
    subject = Subject(sequence)
    runs: list[tuple[str, Callable[[Progress], Result]]] = []
    for method in methods:
        for setting in method_sweep(method, sequence.n_frames, sequence.n_verts, quick=quick):
            name = f"{method} {setting.params}"
            runs.append((name, partial(run_method, subject, setting, store)))
    for peer in peers:
        for value in peer.sweep(quick=quick):
            name = f"{peer.name} {peer.params(value)}"
            runs.append((name, partial(run_peer, subject, peer, value, store)))
    found = []
    for number, (name, work) in enumerate(runs):
        listener = _within(progress, f"{slug}: {name}", Count(number, len(runs), "runs"))
        listener("", 0.0)
        found.append(work(listener))
    return found


def _within(progress: Progress, run: str, share: Count) -> Progress:
    """A listener that says at which stage of which run of how many the work is."""
    return lambda stage, _: progress(f"{run}, {stage}" if stage else run, share)


def _no_recorded(sequence: dict[str, Any]) -> str:
    return (
        f"no recorded row is of {sequence['name'] or 'a sequence without a name'} with "
        f"{sequence['n_verts']} vertices (n) and {sequence['n_frames']} frames (k)"
    )
