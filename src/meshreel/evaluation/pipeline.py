"""The way of every evaluation: a plan of runs, their results, pictures, and a report of them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from meshreel.evaluation.folder import claim_folder, unique_names, write_text
from meshreel.evaluation.runs.run import Run, run_all
from meshreel.evaluation.runs.store import Result, Store
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.documents.html import to_html
from meshreel.rendering.documents.parts import (
    Bullets,
    Code,
    Document,
    Heading,
    Paragraph,
    Part,
    Picture,
    Table,
)
from meshreel.rendering.plots import require_matplotlib
from meshreel.runtime.progress import Count, Progress, silent


class Results(Protocol):
    """Everything that was measured on one sequence."""

    def as_dict(self) -> dict[str, Any]:
        """All of it that a summary shows, in plain types."""


R = TypeVar("R", bound=Results)


Measured = Sequence[tuple[R, Sequence[Picture]]]
"""The results of each sequence with the pictures drawn of them."""


@dataclass(frozen=True, eq=False)
class Subject:
    """A sequence under evaluation.

    Attributes
    ----------
    slug : str
        Begins the names of its pictures.
    store : Store
        Its results on disk.
    """

    sequence: MeshSequence
    slug: str
    store: Store


class Study(Protocol[R]):
    """Runs for a sequence, and tables, pictures and a report of their results."""

    @property
    def program(self) -> str:
        """The command that its folders belong to."""

    def plan(self, sequence: MeshSequence) -> Mapping[str, Sequence[Run]]:
        """The runs of a sequence, by the name of what they are for."""

    def collect(self, subject: Subject, found: Mapping[str, list[Result]], progress: Progress) -> R:
        """The results of the planned runs as one value."""

    def drawings(
        self, subject: Subject, results: R, folder: Path
    ) -> Iterable[Callable[[], Picture]]:
        """A function for each picture that the results allow, which draws it into the folder."""

    def notes(self, measured: Measured[R]) -> dict[str, list[str]]:
        """Lines on what was asked for and could not be had, by their name in the summary."""

    def document(self, measured: Measured[R], command: str) -> Document:
        """The report that says which command it was made by."""


@dataclass(frozen=True)
class Evaluation(Generic[R]):
    """A finished evaluation.

    Attributes
    ----------
    markdown, html : Path
        The report.
    measured : list of (results, list of Picture)
    notes : dict of str to list of str
        Lines on what was asked for and could not be had.
    """

    markdown: Path
    html: Path
    measured: list[tuple[R, list[Picture]]]
    notes: dict[str, list[str]]

    def as_dict(self) -> dict[str, Any]:
        """Paths, notes and figures, in plain types."""
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
    """Run a study on the sequences, and write the report of it.

    Results that the folder has already are not computed again.

    Parameters
    ----------
    sequences : sequence of MeshSequence
    out : Path
        A new or an empty folder, or one that an earlier run made.
    command : str
        The command line that the report names; that of the study without options if it is empty.
    progress : callable

    Raises
    ------
    InvalidInputError
        If matplotlib is missing, or the folder holds something else.
    """
    require_matplotlib()
    command = command or study.program
    claim_folder(out, study.program, command)
    drawn = out / "figures"
    drawn.mkdir(exist_ok=True)
    measured = []
    for sequence, slug in zip(sequences, unique_names(sequences), strict=True):
        subject = Subject(sequence, slug, Store.for_sequence(out / "results", sequence))
        results = measure(study, subject, progress)
        measured.append((results, draw(study, subject, results, drawn, progress)))
    progress("writing the report", 0.0)
    markdown, html = publish(study.document(measured, command), out)
    return Evaluation(markdown, html, measured, study.notes(measured))


def measure(study: Study[R], subject: Subject, progress: Progress) -> R:
    """The results of one sequence: of all runs that the study plans."""

    def listener(stage: str, share: float) -> None:
        progress(f"{subject.slug}: {stage}", share)

    found = run_all(study.plan(subject.sequence), subject.store, listener)
    return study.collect(subject, found, listener)


def draw(
    study: Study[R], subject: Subject, results: R, folder: Path, progress: Progress
) -> list[Picture]:
    """All pictures of one sequence, in the order of the study."""
    works = list(study.drawings(subject, results, folder))
    drawn = []
    for number, work in enumerate(works):
        progress(f"{subject.slug}: drawing", Count(number, len(works), "figures"))
        drawn.append(work())
    return drawn


def publish(document: Document, out: Path) -> tuple[Path, Path]:
    """Write report.md and report.html into the folder that holds the pictures; their paths."""
    markdown, html = out / "report.md", out / "report.html"
    write_text(markdown, to_markdown(document.parts, out))
    write_text(html, to_html(document.parts, document.title))
    return markdown, html


def to_markdown(parts: Sequence[Part], folder: Path) -> str:
    """The report as Markdown; pictures are named relative to the folder it will lie in."""
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
