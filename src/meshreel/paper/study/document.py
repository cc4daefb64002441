"""The report of the paper's evaluation."""

from collections.abc import Sequence

from meshreel.evaluation.pipeline import Measured
from meshreel.evaluation.report import report_opening, sequence_opening
from meshreel.evaluation.runs.store import done
from meshreel.paper.study.decompositions import N_DECOMPOSITIONS
from meshreel.paper.study.findings import findings
from meshreel.paper.study.printed import REMARKS, printed_rates
from meshreel.paper.study.remarks import CHOICES
from meshreel.paper.study.results import PaperResults, setting_of_result
from meshreel.paper.study.tables import (
    alternatives_table,
    quality_table,
    rate_table,
    refusals,
    seconds_table,
    settings_line,
)
from meshreel.rendering.documents import Bullets, Document, Heading, Paragraph, Part, Picture

ALTERNATIVES_NOTE = (
    "Each row changes one choice that the paper leaves open (`choices=`); all other settings are "
    "those of the tables."
)
TITLE = "Fast Spatio-temporal Compression of Dynamic 3D Meshes: the evaluation reproduced"


def paper_document(measured: Measured[PaperResults], command: str) -> Document:
    """Build the report of sequences and their figures; it quotes the command line."""
    finished = (result for results, _ in measured for result in done(results.variants))
    parts: list[Part] = [
        *report_opening(
            TITLE,
            "The evaluation of G. Arvanitis, A. S. Lalos, K. Moustakas, reproduced with meshreel. "
            "All results are from streams that were encoded to bytes and decoded. Created by",
            command,
            finished,
        ),
        Heading(2, "Variants"),
        Bullets(_variant_lines(measured)),
    ]
    for results, pictures in measured:
        parts += _sequence_parts(results, pictures)
    parts += [Heading(2, "Choices that the paper leaves open"), Bullets(CHOICES)]
    return Document(TITLE, tuple(parts))


def _variant_lines(measured: Measured[PaperResults]) -> tuple[str, ...]:
    """The distinct settings as text."""
    lines: list[str] = []
    for results, _ in measured:
        for result in results.variants:
            setting = setting_of_result(result)
            line = f"`{setting.label}`: {settings_line(setting)}"
            if line not in lines:
                lines.append(line)
    return tuple(lines)


def _sequence_parts(results: PaperResults, pictures: Sequence[Picture]) -> list[Part]:
    parts = sequence_opening(results.name, results.sequence)
    remark = REMARKS.get(results.name.lower())
    if remark:
        parts.append(Paragraph(remark))
    texts = tuple(finding.text for finding in findings(results))
    parts += [Heading(3, "Findings"), Bullets(texts or ("None to compare.",))]
    parts += [Heading(3, "Rates and errors"), rate_table(results), Paragraph(_rate_note(results))]
    parts += [quality_table(results), *(Paragraph(text) for text in refusals(results))]
    if results.alternatives:
        parts += [alternatives_table(results), Paragraph(ALTERNATIVES_NOTE)]
    parts += [Heading(3, "Seconds"), seconds_table(results), Paragraph(_seconds_note(results))]
    return [*parts, Heading(3, "Figures"), *pictures]


def _rate_note(results: PaperResults) -> str:
    text = (
        "q, q_a, q_d and q_s are the paper's count: one coordinate matrix of three, without "
        "connectivity. q and q_a are measured in the stream; 'q, fixed length' is without entropy "
        "coding, 'q_a at 16 bits' is 16 n_c / n. The last two columns refer to the whole file."
    )
    if printed_rates(results.name):
        text += " Columns named 'paper' contain its printed values; it has no row for `gft`."
    return text


def _seconds_note(results: PaperResults) -> str:
    finished = done(results.variants)
    text = f"Measured: {finished[0]['seconds']['measured']}. " if finished else ""
    text += "The median of three runs if one takes less than two seconds, else one run."
    if results.decompositions is not None:
        each = results.decompositions["seconds_each"]
        text += (
            f" * Extrapolated from {N_DECOMPOSITIONS} decompositions: {each:.3g} s each for "
            f"{results.decompositions['n_modes']} graph frequencies, added for every frame after "
            "the first, both to encoding and to reconstruction. All other values are measured in "
            "full."
        )
    return text
