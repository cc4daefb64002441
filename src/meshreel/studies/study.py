"""Execute a study: runs, results, pictures, report."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.documents import Part, Picture, Table
from meshreel.rendering.plots import require_matplotlib
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import PEERS
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.version import __version__
from meshreel.studies.runs import Result, Run, Store, file_name, run_all, usable, write_text
from meshreel.studies.timing import machines_text


class Results(Protocol):
    """All measurements of one sequence."""

    @property
    def name(self) -> str:
        """Name of the sequence in tables and pictures."""

    @property
    def sequence(self) -> dict[str, Any]:
        """Its name, shape and hash."""

    @property
    def measured(self) -> list[Result]:
        """Results that record their machine, and refusals."""

    def as_dict(self) -> dict[str, Any]:
        """Contents of the summary, in plain types."""


R = TypeVar("R", bound=Results)


@dataclass(frozen=True, eq=False)
class Subject:
    """A sequence under evaluation."""

    sequence: Any
    slug: str
    """Prefix of the names of its pictures."""
    store: Store
    """Its results on disk."""


class Study(Protocol[R]):
    """Plans runs for a sequence and presents their results.

    `program` is the command that owns its folders; `introduction` precedes the command line in the
    report.
    """

    @property
    def program(self) -> str: ...  # noqa: D102
    @property
    def title(self) -> str: ...  # noqa: D102
    @property
    def introduction(self) -> str: ...  # noqa: D102

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

    def notes(self, measured: Sequence[R]) -> list[str]:
        """Lines about missing results."""

    def preface(self, measured: Sequence[R]) -> list[Part]:
        """Parts of the report before those of sequences."""

    def section(self, results: R, pictures: Sequence[Picture]) -> list[Part]:
        """Parts of a sequence, below its heading."""

    def appendix(self) -> list[Part]:
        """Parts of the report after those of sequences."""


@dataclass(frozen=True)
class Evaluation(Generic[R]):
    """A finished evaluation."""

    report: Path
    """Markdown, with pictures in a folder next to it."""
    measured: list[tuple[R, list[Picture]]]
    notes: list[str]
    """Lines about missing results."""

    def as_dict(self) -> dict[str, Any]:
        """Paths, notes and results, in plain types."""
        return {
            "report": str(self.report),
            "not_measured": self.notes,
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
    sequences : sequence of MeshSequence
        Each of one segment.
    out : Path
        A new or empty folder, or one of an earlier run.
    command : str
        The command line for the report. Default: that of the study without options.

    Raises
    ------
    InvalidInputError
        If matplotlib or SciPy is missing, or the folder contains other files.
    """
    require_matplotlib()
    PEERS.load()
    command = command or study.program
    claim_folder(out, study.program, command)
    folder = out / "figures"
    folder.mkdir(exist_ok=True)
    measured = []
    for sequence, slug in zip(sequences, unique_names(sequences), strict=True):
        subject = Subject(sequence, slug, Store.for_sequence(out / "results", sequence))
        results = measure(study, subject, progress)
        drawings = list(study.drawings(subject, results, folder))
        pictures = []
        for number, draw in enumerate(drawings):
            progress(f"{slug}: drawing", Count(number, len(drawings), "figures"))
            pictures.append(draw())
        measured.append((results, pictures))
    progress("writing the report", 0.0)
    report = out / "report.md"
    write_text(report, to_markdown(parts_of_report(study, measured, command), out))
    return Evaluation(report, measured, study.notes([results for results, _ in measured]))


def measure(study: Study[R], subject: Subject, progress: Progress) -> R:
    """Execute all runs that the study plans for one sequence."""

    def listener(stage: str, share: float) -> None:
        progress(f"{subject.slug}: {stage}", share)

    groups = run_all(study.plan(subject.sequence), subject.store, listener)
    return study.collect(subject, groups, listener)


def claim_folder(folder: Path, program: str, command: str) -> None:
    """Create the folder of a report, or reuse one of an earlier run of the same program.

    The command line is recorded in the folder.

    Raises
    ------
    InvalidInputError
        If the folder contains files but no marker of this program.
    """
    if folder.exists() and not folder.is_dir():
        raise InvalidInputError(f"{folder} is a file; name a folder")
    marker = folder / f"{program.replace(' ', '-')}.json"
    try:
        earlier = json.loads(marker.read_text(encoding="utf-8"))
        is_ours = isinstance(earlier, dict) and earlier.get("made_by") == program
    except (OSError, ValueError):
        is_ours = False
    if folder.is_dir() and any(folder.iterdir()) and not is_ours:
        raise InvalidInputError(
            f"the folder {folder} contains files but no {marker.name} of an earlier run; "
            "name an empty or new folder"
        )
    folder.mkdir(parents=True, exist_ok=True)
    facts = {"made_by": program, "version": __version__, "command": command}
    write_text(marker, json.dumps(facts, indent=1))


def unique_names(sequences: Sequence[MeshSequence]) -> list[str]:
    """Distinct file names of sequences."""
    names: list[str] = []
    for sequence in sequences:
        name, number = file_name(sequence.name), 1
        while name in names:
            number += 1
            name = f"{file_name(sequence.name)}-{number}"
        names.append(name)
    return names


def checked_names(names: Iterable[str], known: Sequence[str], noun: str) -> tuple[str, ...]:
    """Return the distinct names in the order of `known`.

    Raises
    ------
    InvalidInputError
        If a name is unknown, or `names` is empty.
    """
    selected = set(names)
    unknown = sorted(selected - set(known))
    if unknown or not selected:
        problem = f"{noun} {unknown[0]!r} is unknown" if unknown else f"name at least one {noun}"
        raise InvalidInputError(f"{problem}; choose from {', '.join(known)}")
    return tuple(name for name in known if name in selected)


def parts_of_report(
    study: Study[R], measured: Sequence[tuple[R, Sequence[Picture]]], command: str
) -> list[Part]:
    """The report of a study, which quotes the command line."""
    collected = [results for results, _ in measured]
    machines = machines_text(result for results in collected for result in usable(results.measured))
    parts: list[Part] = [f"# {study.title}", study.introduction, f"```\n{command}\n```"]
    parts += [machines] if machines else []
    parts += study.preface(collected)
    for results, pictures in measured:
        sequence = results.sequence
        parts.append(f"## {results.name}")
        parts.append(
            f"{counted(sequence['n_frames'], 'frame')}, {counted(sequence['n_verts'], 'vertex')}, "
            f"{counted(sequence['n_faces'], 'face')} "
            f"(SHA-256 of the content begins with `{sequence['sha256'][:12]}`)."
        )
        parts += study.section(results, pictures)
    return [*parts, *study.appendix()]


def to_markdown(parts: Sequence[Part], folder: Path) -> str:
    """The report as Markdown, with paths of pictures relative to its folder."""
    return "\n\n".join(_markdown(part, folder) for part in parts) + "\n"


def _markdown(part: Part, folder: Path) -> str:
    match part:
        case str():
            return part
        case Table(title, header, rows):
            return f"**{title}**\n\n{markdown_table(header, rows)}"
        case Picture(path, title, caption):
            name = path.relative_to(folder).as_posix()
            return f"![{title}]({name})\n\n**{title}.** {caption}"


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table whose first column is text and whose others are numbers."""
    lines = [header, ("---", *["---:"] * (len(header) - 1)), *rows]
    return "\n".join(map(markdown_row, lines))


def markdown_row(cells: Iterable[str]) -> str:
    """A row of a Markdown table."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
