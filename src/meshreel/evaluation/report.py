"""The frame of reports: openings, and the document that compares codecs."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Protocol, TypeVar

from meshreel.evaluation.runs.store import Result, done
from meshreel.evaluation.runs.timing import machines_text
from meshreel.rendering.documents import Bullets, Code, Document, Heading, Paragraph, Part, Picture
from meshreel.runtime.counting import counted


def report_opening(
    title: str, introduction: str, command: str, results: Iterable[Mapping[str, Any]]
) -> list[Part]:
    """Title, introduction of the command, the command, and the machines of the results."""
    machines = machines_text(results)
    parts: list[Part] = [Heading(1, title), Paragraph(introduction), Code(command)]
    return [*parts, Paragraph(machines)] if machines else parts


def sequence_opening(name: str, sequence: Mapping[str, Any]) -> list[Part]:
    """Heading and description of a sequence, from its identity in the results."""
    segments = ", "
    if "n_segments" in sequence:
        segments = f" in {counted(sequence['n_segments'], 'segment')}, up to "
    return [
        Heading(2, name),
        Paragraph(
            f"{counted(sequence['n_frames'], 'frame')}{segments}"
            f"{counted(sequence['n_verts'], 'vertex')}, "
            f"{counted(sequence['n_faces'], 'face')} (SHA-256 of the content begins with "
            f"`{sequence['sha256'][:12]}`)."
        ),
    ]


class Results(Protocol):
    """Results of one sequence."""

    @property
    def measured(self) -> list[Result]:
        """Results and refusals, ours first."""


AnyResults = TypeVar("AnyResults", bound=Results)


class Summarized(Protocol):
    """A codec with a name and a one-line summary."""

    @property
    def name(self) -> str:
        """Name on the command line."""

    @property
    def summary(self) -> str:
        """One-line description."""


def codecs_document(
    title: str,
    command: str,
    measured: Iterable[tuple[AnyResults, Sequence[Picture]]],
    parts_of: Callable[[AnyResults, Sequence[Picture]], list[Part]],
    *,
    methodology: tuple[str, ...],
    peers: Sequence[Summarized],
    notes: Sequence[str],
) -> Document:
    """A report that compares our codec with others.

    Parameters
    ----------
    command : str
        The command line that created the report.
    measured : iterable of (results, pictures)
        Of each sequence.
    parts_of : callable
        Returns the section of a sequence.
    methodology : tuple of str
        How results were measured.
    peers : sequence of Summarized
        The available codecs among the requested ones.
    notes : sequence of str
        Lines about missing results.
    """
    sections = [(done(results.measured), parts_of(results, each)) for results, each in measured]
    finished = [result for results, _ in sections for result in results]
    parts = report_opening(title, "Created by", command, finished)
    if notes:
        parts += [Heading(2, "Not measured"), Bullets(tuple(notes))]
    parts += [part for _, section in sections for part in section]
    parts += [Heading(2, "How it was measured"), Bullets(methodology)]
    if peers:
        lines = tuple(f"`{peer.name}`: {peer.summary}" for peer in peers)
        parts += [Heading(2, "Other codecs"), Bullets(lines)]
    return Document(title, tuple(parts))
