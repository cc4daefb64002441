"""Execute a study: runs, results, pictures, report."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from meshreel.evaluation.folder import claim_folder, unique_names, write_text
from meshreel.evaluation.runs.store import Result, Run, Store, run_all
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.documents import (
    Bullets,
    Code,
    Document,
    Heading,
    Paragraph,
    Part,
    Picture,
    Table,
    to_html,
)
from meshreel.rendering.plots import require_matplotlib
from meshreel.runtime.extras import PEERS
from meshreel.runtime.progress import Count, Progress, silent


class Results(Protocol):
    """All measurements of one sequence."""

    def as_dict(self) -> dict[str, Any]:
        """Contents of the summary, in plain types."""


R = TypeVar("R", bound=Results)


Measured = Sequence[tuple[R, Sequence[Picture]]]
"""Results and pictures of each sequence."""


@dataclass(frozen=True, eq=False)
class Subject:
    """A sequence under evaluation.

    Attributes
    ----------
    sequence : MeshSequence
    slug : str
        Prefix of the names of its pictures.
    store : Store
        Its results on disk.
    """

    sequence: Any
    slug: str
    store: Store


class Study(Protocol[R]):
    """Plans runs for a sequence and presents their results."""

    @property
    def program(self) -> str:
        """The command that owns its folders."""

    def plan(self, sequence: Any) -> Mapping[str, Sequence[Run]]:
        """The runs of a `MeshSequence`, or of any sequence, in named groups."""

    def collect(
        self, subject: Subject, groups: Mapping[str, list[Result]], progress: Progress
    ) -> R:
        """Combine the results of all groups of runs."""

    def drawings(
        self, subject: Subject, results: R, folder: Path
    ) -> Iterable[Callable[[], Picture]]:
        """Functions that each draw one picture into the folder."""

    def notes(self, measured: Measured[R]) -> dict[str, list[str]]:
        """Lines about missing results, by their name in the summary."""

    def document(self, measured: Measured[R], command: str) -> Document:
        """The report; it quotes the command."""


@dataclass(frozen=True)
class Evaluation(Generic[R]):
    """A finished evaluation.

    Attributes
    ----------
    markdown, html : Path
        The report.
    measured : list of (results, list of Picture)
    notes : dict of str to list of str
        Lines about missing results.
    """

    markdown: Path
    html: Path
    measured: list[tuple[R, list[Picture]]]
    notes: dict[str, list[str]]

    def as_dict(self) -> dict[str, Any]:
        """Paths, notes and results, in plain types."""
        return {
            "report": {"markdown": str(self.markdown), "html": str(self.html)},
            **self.notes,
            "sequences": [
                {**results.as_dict(), "figures": [str(picture.path) for picture in pictures]}
                for results, pictures in self.measured
            ],
        }


def evaluate(
    study: Study[R],
    sequences: Sequence[MeshSequence],
    out: Path,
    *,
    command: str = "",
    progress: Progress = silent,
) -> Evaluation[R]:
    """Run a study on the sequences and write its report; stored results are reused.

    Parameters
    ----------
    sequences : sequence of MeshSequence, or of MeshSequence
        The latter only for studies of surfaces.
    out : Path
        A new or empty folder, or one of an earlier run.
    command : str
        The command line for the report. Default: that of the study without options.
    progress : callable

    Raises
    ------
    InvalidInputError
        If matplotlib or SciPy is missing, or the folder contains other files.
    """
    require_matplotlib()
    PEERS.load()
    command = command or study.program
    claim_folder(out, study.program, command)
    figures = out / "figures"
    figures.mkdir(exist_ok=True)
    measured = []
    for sequence, slug in zip(sequences, unique_names(sequences), strict=True):
        subject = Subject(sequence, slug, Store.for_sequence(out / "results", sequence))
        results = measure(study, subject, progress)
        measured.append((results, draw(study, subject, results, figures, progress)))
    progress("writing the report", 0.0)
    markdown, html = publish(study.document(measured, command), out)
    return Evaluation(markdown, html, measured, study.notes(measured))


def measure(study: Study[R], subject: Subject, progress: Progress) -> R:
    """Execute all runs that the study plans for one sequence."""

    def listener(stage: str, share: float) -> None:
        progress(f"{subject.slug}: {stage}", share)

    groups = run_all(study.plan(subject.sequence), subject.store, listener)
    return study.collect(subject, groups, listener)


def draw(
    study: Study[R], subject: Subject, results: R, folder: Path, progress: Progress
) -> list[Picture]:
    """Draw all pictures of one sequence, in the order of the study."""
    drawings = list(study.drawings(subject, results, folder))
    pictures = []
    for number, drawing in enumerate(drawings):
        progress(f"{subject.slug}: drawing", Count(number, len(drawings), "figures"))
        pictures.append(drawing())
    return pictures


def publish(document: Document, out: Path) -> tuple[Path, Path]:
    """Write report.md and report.html next to the pictures and return their paths."""
    markdown, html = out / "report.md", out / "report.html"
    write_text(markdown, to_markdown(document.parts, out))
    write_text(html, to_html(document.parts, document.title))
    return markdown, html


def to_markdown(parts: Sequence[Part], folder: Path) -> str:
    """The report as Markdown, with paths of pictures relative to its folder."""
    return "\n\n".join(_markdown(part, folder) for part in parts) + "\n"


def _markdown(part: Part, folder: Path) -> str:
    match part:
        case Heading(level, text):
            return f"{'#' * level} {text}"
        case Paragraph(text):
            return text
        case Code(text):
            return f"```\n{text}\n```"
        case Bullets(items):
            return "\n".join(f"- {item}" for item in items)
        case Table():
            return _markdown_table(part)
        case Picture(path, title, caption):
            name = path.relative_to(folder).as_posix()
            return f"![{title}]({name})\n\n**{title}.** {caption}"


def _markdown_table(table: Table) -> str:
    lines = [table.header, ("---", *["---:"] * (len(table.header) - 1)), *table.rows]
    cells = [[cell.replace("|", "\\|") for cell in line] for line in lines]
    body = "\n".join("| " + " | ".join(line) + " |" for line in cells)
    return f"**{table.title}**\n\n{body}"
