"""The study that reproduces the paper's evaluation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from meshreel.model.sequence import MeshSequence
from meshreel.paper.experiment import ExperimentSeries
from meshreel.paper.study.figures import diagrams, matrices, meshes
from meshreel.paper.study.findings import CLAIMS, NOT_JUDGED, findings
from meshreel.paper.study.rate_sweeps import axes_of, starts, swept, window_around
from meshreel.paper.study.results import (
    RATE,
    PaperResults,
    RateSweep,
    extrapolated_basis,
    setting_of_result,
)
from meshreel.paper.study.runs import (
    MEASURED,
    N_DECOMPOSITIONS,
    decompositions_run,
    dictionaries_run,
    full_decomposition_run,
    long_run,
    quiet_blocks_run,
    sparsity_run,
    sweep_run,
    variant_run,
)
from meshreel.paper.study.tables import (
    REMARKS,
    alternatives_table,
    misprints,
    printed_rates,
    quality_table,
    rate_table,
    refusals,
    seconds_table,
    settings_line,
)
from meshreel.paper.sweeps import (
    DEFAULTS,
    METHOD_NAMES,
    Setting,
    TableSettings,
    alternatives,
    row_settings,
    variants,
)
from meshreel.rendering.documents import Part, Picture, bullets
from meshreel.runtime.progress import Progress
from meshreel.studies.runs import Result, Run, result_of, usable
from meshreel.studies.study import Subject

ALTERNATIVES_NOTE = (
    "Each row changes one choice that the paper leaves open (`choices=`); all other settings are "
    "those of the tables."
)
LEDGER = "`docs/equations.md`"

CHOICES = (
    "**Eq. 3 or Eq. 4.** The paper presents the two as equivalent, but with L = D - C they differ "
    "by the degree of each vertex. The streams here use Eq. 3, L = I - D^-1 C; `gft` computes its "
    f"frequencies from D - C, which is symmetric ({LEDGER}, Eq. 3).",
    "**The n_b^2 of Eq. 13.** It makes q_d of n_b blocks as large as that of one k x k dictionary, "
    "but n_b dictionaries have n_b k_f^2 entries. The column q_d is as printed, with 16 bits for "
    "each entry and for `blocks` the mean bits of an entry in the stream. 'q_d as stored' counts "
    f"the bytes of the k_l columns that a stream contains ({LEDGER}, Eq. 13).",
    "**One coordinate of three.** The paper's q_d = 16 k / n is one k x k dictionary, so it counts "
    "one coordinate matrix, without connectivity. q, q_a, q_d and q_s count entries times bits as "
    "Eq. 13 does; 'as stored' is a third of the bytes in the stream, after entropy coding. 'bpvf "
    "of the file' counts all bits per vertex and frame: three coordinates, connectivity, order, "
    "headers.",
    "**Anchors.** Eq. 12 uses the positions of the anchors in all frames, and Table I counts 16 "
    "bits for each. We code these positions, predicted from the modes, with 4 bits more than the "
    "deltas, or with 16 (`--preset printed`). The paper also prints q_a for v2v, but decoding by a "
    "product uses no anchors, so that cell contains '-'. Its 0.1595 for Samba is 16 times 99.71 "
    "anchors over the 10,002 vertices of Handstand; 100 of 9,971 vertices take 0.1605.",
    "**Variant (ii)** is described as the projection of quantized deltas, while Eq. 10 quantizes "
    "projected deltas. `pca-q` follows Eq. 10; `pca-q (quantized deltas)` is the other reading, "
    "which codes its projections with 16 bits.",
    "**NMSVE.** The paper gives no normalization. Positions are divided by the diagonal of the "
    "first frame's bounding box, and a frame's error by 2 n: our values are comparable with each "
    f"other, but not with the axis of the paper's Fig. 4 ({LEDGER}).",
    "**Decoding without anchors.** L of Eq. 11 has no inverse: constants on a component are in "
    "its kernel. `pca` and `pca-q` store one vertex of each component, which only fixes its "
    f"translation ({LEDGER}, Eq. 11).",
    "**Quantizer Q.** Eq. 10 leaves it open. One step is used for all rows, with which the largest "
    "coefficient takes the given bits; the coefficients are entropy-coded, so q is their size in "
    f"the file and not the given bits ({LEDGER}, Eq. 10).",
    "**k_l and bits.** The paper prints neither for its tables. The default is 20 rows, beyond "
    "which its Fig. 3 shows no improvement, and 8 bits, 16 for `pca`; 11 bits for `v2v`, a "
    "compromise between KG and STED, and 4 rows in each block of `blocks`. Values of q are "
    "therefore hardly comparable; the rate-distortion plots show errors at equal rate. Without "
    "entropy coding its Samba rates are nearly 8 rows at 16 and at 4 bits: `--preset printed`.",
    "**Per mesh.** `gft` uses the low graph frequencies of every frame, by default 5 % of them. L "
    "is the same for all frames, so one decomposition suffices; the paper computes one for each, "
    "with all frequencies.",
)


def variant_lines(measured: Sequence[PaperResults]) -> tuple[str, ...]:
    """The distinct settings as text."""
    variants = (result for results in measured for result in results.variants)
    settings = map(setting_of_result, variants)
    lines = (f"`{setting.label}`: {settings_line(setting)}" for setting in settings)
    return tuple(dict.fromkeys(lines))


def sequence_parts(results: PaperResults, pictures: Sequence[Picture]) -> list[Part]:
    """Findings, tables and figures of a sequence."""
    remark = REMARKS.get(results.name.lower())
    parts: list[Part] = [remark] if remark else []
    every = findings(results)
    judged = [finding for finding in every if finding.verdict != NOT_JUDGED]
    others = [finding for finding in every if finding.verdict == NOT_JUDGED]
    if results.is_quick:
        parts.append(
            "A quick study: its sweeps have few points, so verdicts may change without it."
        )
    parts += ["### Findings", bullets(tuple(finding.text for finding in judged))]
    if others:
        texts = (f"{finding.claim.text}: {finding.evidence.text}" for finding in others)
        parts += [f"### Not judged: {len(others)} of {len(CLAIMS)}", bullets(tuple(texts))]
    note = (
        "q, q_a, q_d and q_s are Eq. 13: entries of one coordinate matrix of three times their "
        "bits, without connectivity. 'As stored' is a third of the bytes that these parts take in "
        "the stream. The last two columns refer to the whole file."
    )
    if printed_rates(results.name):
        note += " Columns named 'paper' contain its printed values; it has no row for `gft`. "
        note += misprints(results.name)
    parts += ["### Rates and errors", rate_table(results), note]
    parts += [quality_table(results), *refusals(results)]
    if results.alternatives:
        parts += [alternatives_table(results), ALTERNATIVES_NOTE]
    parts += ["### Seconds", seconds_table(results), _seconds_note(results)]
    return [*parts, "### Figures", *pictures]


def _seconds_note(results: PaperResults) -> str:
    text = f"Measured: {MEASURED}. " if usable(results.variants) else ""
    text += "The median of three runs if one takes less than 15 seconds, else one run."
    if results.decompositions is not None:
        seconds = results.decompositions["processor_seconds_each"]
        text += (
            f" * Extrapolated from {N_DECOMPOSITIONS} decompositions: {seconds:.3g} s each for "
            f"{results.decompositions['n_modes']} graph frequencies, added for every frame after "
            "the first, both to encoding and to reconstruction. All other values are measured in "
            "full."
        )
    full, shape = results.full_decomposition, results.sequence
    if full is None:
        return text
    if "refused" in full:
        return f"{text} Not measured: {full['refused']}."
    basis = extrapolated_basis(full, shape["n_verts"], shape["n_frames"])
    return f"{text} All frequencies: {basis.text} The row contains the decompositions alone."


@dataclass(frozen=True)
class PaperStudy:
    """Evaluate the variants of the paper on any sequences."""

    methods: Sequence[str] = METHOD_NAMES
    """From `sweeps.METHOD_NAMES`."""
    quick: bool = False
    """Use few points in the rate-distortion plots, no alternatives, and no long sequences."""
    table: TableSettings = DEFAULTS
    """Modes, bits and anchors of the streams in the tables."""
    program: str = "meshreel paper"
    title: str = "Fast Spatio-temporal Compression of Dynamic 3D Meshes: the evaluation reproduced"
    introduction: str = (
        "The evaluation of G. Arvanitis, A. S. Lalos, K. Moustakas, reproduced with meshreel. All "
        "results are from streams that were encoded to bytes and decoded. Created by"
    )

    def plan(self, sequence: MeshSequence) -> dict[str, list[Run]]:
        """The runs for tables, alternatives, Fig. 3 and claims; `collect` adds those of sweeps."""
        n_frames = sequence.n_frames
        frame = meshes.uncommon_frame(sequence)
        groups = {
            "variants": variants(n_frames, self.methods, self.table),
            "alternatives": [] if self.quick else alternatives(n_frames, self.methods, self.table),
            "rows": row_settings(n_frames, self.methods),
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
        """The results of all runs, the sweeps, and the timing of decompositions if `gft` was run.

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
            sweeps=self._sweeps(subject, progress),
            alternatives=groups["alternatives"],
            claims={name: result for name, result in claims if "refused" not in result},
            is_quick=self.quick,
        )
        graph = results.variant("gft")
        if graph is None:
            return results
        run = decompositions_run(sequence, max(graph["stream"]["n_modes"]))
        decompositions = usable([result_of(run, store, progress)])
        full = None if self.quick else result_of(full_decomposition_run(sequence), store, progress)
        return replace(
            results,
            decompositions=next(iter(decompositions), None),
            full_decomposition=full,
        )

    def _sweeps(self, subject: Subject, progress: Progress) -> list[RateSweep]:
        sequence, store = subject.sequence, subject.store
        shape, series = (sequence.n_frames, sequence.n_verts), ExperimentSeries(sequence)

        def measure(setting: Setting) -> Result:
            run = sweep_run(series, setting)
            progress(run.name, 0.0)
            return result_of(run, store)

        # All methods have the window of rates of the paper's best variant, also if it is not shown.
        [reference] = starts(*shape, ["pca-qp"])[:1]
        window = window_around(measure(reference)[RATE])
        return [
            swept(start, axes_of(start, *shape), measure, window, is_quick=self.quick)
            for start in starts(*shape, self.methods)
        ]

    def drawings(
        self, subject: Subject, results: PaperResults, folder: Path
    ) -> Iterator[Callable[[], Picture]]:
        """Functions that each draw a figure, in the paper's order."""
        sequence, slug, store = subject.sequence, subject.slug, subject.store
        yield partial(matrices.draw_projected_deltas, sequence, slug, folder)
        if usable(results.rows):
            yield partial(meshes.draw_row_counts, sequence, results.rows, store, slug, folder)
        if not usable(results.variants):
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
        """How many claims are not judged."""
        counts = {
            results.name: sum(each.verdict == NOT_JUDGED for each in findings(results))
            for results in measured
        }
        return [
            f"{name}: {count} of {len(CLAIMS)} claims are not judged; the report says why"
            for name, count in counts.items()
            if count
        ]

    def preface(self, measured: Sequence[PaperResults]) -> list[Part]:
        """The settings of the variants."""
        return ["## Variants", bullets(variant_lines(measured))]

    def section(self, results: PaperResults, pictures: Sequence[Picture]) -> list[Part]:
        """Findings, tables and figures of a sequence."""
        return sequence_parts(results, pictures)

    def appendix(self) -> list[Part]:
        """Our choices where the paper leaves them open."""
        return ["## Choices that the paper leaves open", bullets(CHOICES)]
