"""The whole evaluation: sequences in, results, figures and report out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from meshreel.evaluation.folder import claim_folder, unique_names
from meshreel.evaluation.paper.decompositions import time_decompositions
from meshreel.evaluation.paper.document import write_report
from meshreel.evaluation.paper.figures import diagrams, matrices, meshes
from meshreel.evaluation.paper.measure import run
from meshreel.evaluation.paper.results import (
    SequenceResults,
    method_of_result,
    setting_of_result,
    summary,
)
from meshreel.evaluation.paper.settings import METHOD_NAMES, Setting, row_settings, sweep, variants
from meshreel.evaluation.report.document import Picture
from meshreel.evaluation.runs.store import Result, Store, done
from meshreel.paper.decoder import coded_blocks
from meshreel.rendering.plots import require_matplotlib
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.sequence import MeshSequence

PROGRAM = "meshreel paper"


@dataclass(frozen=True)
class Evaluation:
    """What `reproduce` wrote and measured.

    Attributes
    ----------
    markdown, html : Path
    measured : list of (SequenceResults, list of Picture)
    """

    markdown: Path
    html: Path
    measured: list[tuple[SequenceResults, list[Picture]]]

    def as_dict(self) -> dict[str, Any]:
        """Paths and the figures of the tables, in plain types."""
        return {
            "report": {"markdown": str(self.markdown), "html": str(self.html)},
            "sequences": [
                {
                    **results.sequence,
                    "variants": [summary(result) for result in results.variants],
                    "figures": [str(picture.path) for picture in pictures],
                }
                for results, pictures in self.measured
            ],
        }


def reproduce(
    sequences: Sequence[MeshSequence],
    out: Path,
    *,
    methods: Sequence[str] = METHOD_NAMES,
    quick: bool = False,
    command: str = PROGRAM,
    progress: Progress = silent,
) -> Evaluation:
    """Run the paper's variants on the sequences and write the report of them.

    Results that the folder has already are not computed again.

    Parameters
    ----------
    sequences : sequence of MeshSequence
    out : Path
        A new or an empty folder, or one that an earlier run made.
    methods : sequence of str
        Of `settings.METHOD_NAMES`.
    quick : bool
        Few points in the rate-distortion plots.
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
    measured = []
    for sequence, slug in zip(sequences, unique_names(sequences), strict=True):
        store = Store.for_sequence(out / "results", sequence)
        results = measure(sequence, slug, store, methods=methods, quick=quick, progress=progress)
        measured.append((results, draw(sequence, results, store, drawn, progress=progress)))
    progress("writing the report", 0.0)
    markdown, html = write_report(measured, out, command)
    return Evaluation(markdown, html, measured)


def measure(
    sequence: MeshSequence,
    slug: str,
    store: Store,
    *,
    methods: Sequence[str] = METHOD_NAMES,
    quick: bool = False,
    progress: Progress = silent,
) -> SequenceResults:
    """All results of one sequence, those of the tables first."""
    groups = [
        variants(sequence.n_frames, methods),
        row_settings(sequence.n_frames, methods),
        sweep(sequence.n_frames, sequence.n_verts, methods, quick=quick),
    ]
    n_runs, n_done = sum(map(len, groups)), 0
    shown_frame = meshes.telling_frame(sequence)
    found: tuple[list[Result], ...] = ([], [], [])
    for group, settings in enumerate(groups):
        for setting in settings:
            listener = _listener(progress, slug, setting, n_done, n_runs)
            listener("encode", 0.0)
            found[group].append(
                run(
                    sequence, setting, store,
                    shown_frame=shown_frame, repeat=group == 0, progress=listener,
                )
            )  # fmt: skip
            n_done += 1
    results = SequenceResults(slug, store.sequence, found[0], found[1], found[2])
    graph = results.variant("gft")
    if graph is None:
        return results
    n_modes = max(graph["stream"]["n_modes"])
    decompositions = time_decompositions(
        sequence, n_modes, store, progress=lambda stage, share: progress(f"{slug}: {stage}", share)
    )
    return replace(results, decompositions=decompositions)


def draw(
    sequence: MeshSequence,
    results: SequenceResults,
    store: Store,
    folder: Path,
    *,
    progress: Progress = silent,
) -> list[Picture]:
    """All figures of one sequence that its results allow, in the paper's order."""
    works = list(_drawings(sequence, results, store, folder))
    drawn = []
    for number, work in enumerate(works):
        progress(f"{results.slug}: drawing", Count(number, len(works), "figures"))
        drawn.append(work())
    return drawn


def _drawings(
    sequence: MeshSequence, results: SequenceResults, store: Store, folder: Path
) -> Iterator[Callable[[], Picture]]:
    """What draws each figure, in the paper's order."""
    slug = results.slug
    yield partial(matrices.draw_projected_deltas, sequence, slug, folder)
    if done(results.rows):
        yield partial(meshes.draw_row_counts, sequence, results.rows, store, slug, folder)
    if not done(results.variants):
        return
    yield partial(diagrams.draw_error_per_frame, results, folder)
    yield partial(diagrams.draw_bits_per_row, results, folder)
    blocks = next((r for r in done(results.variants) if method_of_result(r) == "blocks"), None)
    if blocks is not None:
        key = setting_of_result(blocks).key
        data = store.path(key, "reel").read_bytes()
        yield partial(matrices.draw_dictionaries, coded_blocks(data), slug, folder)
    yield partial(meshes.draw_variants, sequence, results.variants, store, slug, folder)
    yield partial(diagrams.draw_rate_distortion, results, folder)


def _listener(
    progress: Progress, slug: str, setting: Setting, n_done: int, n_runs: int
) -> Progress:
    """A listener that says which run of how many is at which stage."""

    def report(stage: str, fraction: float) -> None:
        what = f"{slug}: {setting.label}, {setting.n_modes or 'default'} modes, {setting.bits} bits"
        progress(f"{what}, {stage}", Count(n_done, n_runs, "runs"))

    return report
