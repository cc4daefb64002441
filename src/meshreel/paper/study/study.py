"""The paper's evaluation as a study: its variants, and the figures and the report of them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from meshreel.evaluation.pipeline import Measured, Subject
from meshreel.evaluation.runs.run import Run, result_of
from meshreel.evaluation.runs.store import Result, done
from meshreel.model.sequence import MeshSequence
from meshreel.paper.decoder import coded_blocks
from meshreel.paper.study.claims import dictionaries_run, long_run, quiet_blocks_run
from meshreel.paper.study.decompositions import decompositions_run
from meshreel.paper.study.document import paper_document
from meshreel.paper.study.figures import diagrams, matrices, meshes
from meshreel.paper.study.measure import variant_run
from meshreel.paper.study.results import PaperResults, method_of_result, setting_of_result
from meshreel.paper.sweeps import (
    METHOD_NAMES,
    USUAL,
    TableSettings,
    alternatives,
    row_settings,
    sweep,
    variants,
)
from meshreel.rendering.documents.parts import Document, Picture
from meshreel.runtime.progress import Progress


@dataclass(frozen=True)
class PaperStudy:
    """The variants of the paper on any sequences.

    Attributes
    ----------
    methods : sequence of str
        Of `settings.METHOD_NAMES`.
    quick : bool
        Few points in the rate-distortion plots, no alternatives, and no long sequences.
    table : TableSettings
        Modes, bits and anchors of the streams in the tables.
    """

    methods: Sequence[str] = METHOD_NAMES
    quick: bool = False
    table: TableSettings = USUAL
    program: str = "meshreel paper"

    def plan(self, sequence: MeshSequence) -> dict[str, list[Run]]:
        """The runs of the tables, of alternatives, Fig. 3, rate-distortion plots and claims."""
        n_frames, n_verts = sequence.n_frames, sequence.n_verts
        frame = meshes.telling_frame(sequence)
        groups = {
            "variants": variants(n_frames, self.methods, self.table),
            "alternatives": [] if self.quick else alternatives(n_frames, self.methods, self.table),
            "rows": row_settings(n_frames, self.methods),
            "sweep": sweep(n_frames, n_verts, self.methods, quick=self.quick),
        }
        runs = {
            group: [
                variant_run(sequence, setting, shown_frame=frame, repeat=group == "variants")
                for setting in settings
            ]
            for group, settings in groups.items()
        }
        return {**runs, "claims": self._claims(sequence)}

    def _claims(self, sequence: MeshSequence) -> list[Run]:
        if "blocks" not in self.methods:
            return []
        runs = [dictionaries_run(sequence), quiet_blocks_run(sequence)]
        if "pca-qp" in self.methods and not self.quick:
            runs.append(long_run(sequence, self.table))
        return runs

    def collect(
        self, subject: Subject, found: Mapping[str, list[Result]], progress: Progress
    ) -> PaperResults:
        """The results of all runs, with the seconds of decompositions where `gft` was run."""
        names = [run.name for run in self._claims(subject.sequence)]
        results = PaperResults(
            subject.slug,
            subject.store.sequence,
            variants=found["variants"],
            rows=found["rows"],
            sweep=found["sweep"],
            alternatives=found["alternatives"],
            claims=dict(zip(names, found["claims"], strict=True)),
        )
        graph = results.variant("gft")
        if graph is None:
            return results
        run = decompositions_run(subject.sequence, max(graph["stream"]["n_modes"]))
        decompositions = done([result_of(run, subject.store, progress)])
        return replace(results, decompositions=next(iter(decompositions), None))

    def drawings(
        self, subject: Subject, results: PaperResults, folder: Path
    ) -> Iterator[Callable[[], Picture]]:
        """A function for each figure, in the paper's order."""
        sequence, slug, store = subject.sequence, subject.slug, subject.store
        yield partial(matrices.draw_projected_deltas, sequence, slug, folder)
        if done(results.rows):
            yield partial(meshes.draw_row_counts, sequence, results.rows, store, slug, folder)
        if not done(results.variants):
            return
        yield partial(diagrams.draw_error_per_frame, results, folder)
        yield partial(diagrams.draw_bits_per_row, results, folder)
        blocks = next((r for r in done(results.variants) if method_of_result(r) == "blocks"), None)
        if blocks is not None:
            data = store.path(setting_of_result(blocks).key, "reel").read_bytes()
            yield partial(matrices.draw_dictionaries, sequence, coded_blocks(data), slug, folder)
        yield partial(meshes.draw_variants, sequence, results.variants, store, slug, folder)
        yield partial(diagrams.draw_rate_distortion, results, folder)

    def notes(self, measured: Measured[PaperResults]) -> dict[str, list[str]]:
        """No lines: no variant needs a package that may be missing."""
        return {}

    def document(self, measured: Measured[PaperResults], command: str) -> Document:
        """The report: tables, findings and figures of each sequence."""
        return paper_document(measured, command)
