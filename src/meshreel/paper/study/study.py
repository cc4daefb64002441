"""The study that reproduces the paper's evaluation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from meshreel.model.sequence import MeshSequence
from meshreel.paper.study.claims import (
    decompositions_run,
    dictionaries_run,
    full_decomposition_run,
    long_run,
    quiet_blocks_run,
    sparsity_run,
)
from meshreel.paper.study.document import CHOICES, sequence_parts, variant_lines
from meshreel.paper.study.figures import diagrams, matrices, meshes
from meshreel.paper.study.measure import variant_run
from meshreel.paper.study.results import PaperResults, setting_of_result
from meshreel.paper.sweeps import (
    DEFAULTS,
    METHOD_NAMES,
    TableSettings,
    alternatives,
    row_settings,
    sweep,
    variants,
)
from meshreel.rendering.documents import Bullets, Heading, Part, Picture
from meshreel.runtime.progress import Progress
from meshreel.studies.runs import Result, Run, done, result_of
from meshreel.studies.study import Subject


@dataclass(frozen=True)
class PaperStudy:
    """Evaluate the variants of the paper on any sequences.

    Attributes
    ----------
    methods : sequence of str
        From `sweeps.METHOD_NAMES`.
    quick : bool
        Use few points in the rate-distortion plots, no alternatives, and no long sequences.
    table : TableSettings
        Modes, bits and anchors of the streams in the tables.
    """

    methods: Sequence[str] = METHOD_NAMES
    quick: bool = False
    table: TableSettings = DEFAULTS
    program: str = "meshreel paper"
    title: str = "Fast Spatio-temporal Compression of Dynamic 3D Meshes: the evaluation reproduced"
    introduction: str = (
        "The evaluation of G. Arvanitis, A. S. Lalos, K. Moustakas, reproduced with meshreel. All "
        "results are from streams that were encoded to bytes and decoded. Created by"
    )

    def plan(self, sequence: MeshSequence) -> dict[str, list[Run]]:
        """The runs for tables, alternatives, Fig. 3, rate-distortion plots and claims."""
        n_frames, n_verts = sequence.n_frames, sequence.n_verts
        frame = meshes.uncommon_frame(sequence)
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
        runs = [sparsity_run(sequence)]
        if "blocks" not in self.methods:
            return runs
        runs += [dictionaries_run(sequence), quiet_blocks_run(sequence)]
        if "pca-qp" in self.methods and not self.quick:
            runs.append(long_run(sequence, self.table))
        return runs

    def collect(
        self, subject: Subject, groups: Mapping[str, list[Result]], progress: Progress
    ) -> PaperResults:
        """The results of all runs, and the timing of decompositions if `gft` was run.

        A quick study omits the full decomposition.
        """
        sequence, store = subject.sequence, subject.store
        names = [run.name for run in self._claims(sequence)]
        claims = zip(names, groups["claims"], strict=True)
        results = PaperResults(
            subject.slug,
            store.sequence,
            variants=groups["variants"],
            rows=groups["rows"],
            sweep=groups["sweep"],
            alternatives=groups["alternatives"],
            claims={name: result for name, result in claims if "refused" not in result},
        )
        graph = results.variant("gft")
        if graph is None:
            return results
        run = decompositions_run(sequence, max(graph["stream"]["n_modes"]))
        decompositions = done([result_of(run, store, progress)])
        full = None if self.quick else result_of(full_decomposition_run(sequence), store, progress)
        return replace(
            results,
            decompositions=next(iter(decompositions), None),
            full_decomposition=full,
        )

    def drawings(
        self, subject: Subject, results: PaperResults, folder: Path
    ) -> Iterator[Callable[[], Picture]]:
        """Functions that each draw a figure, in the paper's order."""
        sequence, slug, store = subject.sequence, subject.slug, subject.store
        yield partial(matrices.draw_projected_deltas, sequence, slug, folder)
        if done(results.rows):
            yield partial(meshes.draw_row_counts, sequence, results.rows, store, slug, folder)
        if not done(results.variants):
            return
        yield partial(diagrams.draw_error_per_frame, results, folder)
        yield partial(diagrams.draw_bits_per_row, results, folder)
        blocks = results.variant("blocks")
        if blocks is not None:
            block_frames = setting_of_result(blocks).block_frames or sequence.n_frames
            shape = block_frames, max(blocks["stream"]["n_modes"])
            yield partial(matrices.draw_dictionaries, sequence, *shape, slug, folder)
        yield partial(meshes.draw_variants, sequence, results.variants, store, slug, folder)
        yield partial(diagrams.draw_rate_distortion, results, folder)

    def notes(self, measured: Sequence[PaperResults]) -> list[str]:
        """Empty: no variant needs an optional package."""
        return []

    def preface(self, measured: Sequence[PaperResults]) -> list[Part]:
        """The settings of the variants."""
        return [Heading(2, "Variants"), Bullets(variant_lines(measured))]

    def section(self, results: PaperResults, pictures: Sequence[Picture]) -> list[Part]:
        """Findings, tables and figures of a sequence."""
        return sequence_parts(results, pictures)

    def appendix(self) -> list[Part]:
        """Our choices where the paper leaves them open."""
        return [Heading(2, "Choices that the paper leaves open"), Bullets(CHOICES)]
