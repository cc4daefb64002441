"""The frame of reports: openings, and the document that compares codecs."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

from meshreel.evaluation.runs.machine import machines_text
from meshreel.rendering.documents.parts import Bullets, Code, Document, Heading, Paragraph, Part
from meshreel.runtime.counting import counted


def report_opening(
    title: str, made_by: str, command: str, results: Iterable[Mapping[str, Any]]
) -> list[Part]:
    """Title, a text that ends before the command, the command, and where seconds are from."""
    machines = machines_text(results)
    parts: list[Part] = [Heading(1, title), Paragraph(made_by), Code(command)]
    return [*parts, Paragraph(machines)] if machines else parts


def sequence_opening(name: str, sequence: Mapping[str, Any]) -> list[Part]:
    """The heading of a sequence and what it consists of, from its identity in the results."""
    return [
        Heading(2, name),
        Paragraph(
            f"{counted(sequence['n_frames'], 'frame')}, {counted(sequence['n_verts'], 'vertex')}, "
            f"{counted(sequence['n_faces'], 'face')} (SHA-256 of the content begins with "
            f"`{sequence['sha256'][:12]}`)."
        ),
    ]


class Summarised(Protocol):
    """A codec that says in a line what it is."""

    @property
    def name(self) -> str:
        """As users write it."""

    @property
    def summary(self) -> str:
        """The line."""


def codecs_document(
    title: str,
    command: str,
    finished: Iterable[Mapping[str, Any]],
    body: Iterable[Part],
    *,
    how: tuple[str, ...],
    peers: Sequence[Summarised],
    notes: Sequence[str],
) -> Document:
    """A report on our codec beside others.

    Parameters
    ----------
    command : str
        The command line that made it.
    finished : iterable of results
        They say which machines seconds are from.
    body : iterable of Part
        On each of the sequences.
    how : tuple of str
        How it was measured.
    peers : sequence of Summarised
        Those that were asked for and are there.
    notes : sequence of str
        Lines on what was asked for and is not in the report.
    """
    parts = report_opening(title, "Made by", command, finished)
    if notes:
        parts += [Heading(2, "Not measured"), Bullets(tuple(notes))]
    parts += [*body, Heading(2, "How it was measured"), Bullets(how)]
    if peers:
        lines = tuple(f"`{peer.name}`: {peer.summary}" for peer in peers)
        parts += [Heading(2, "Other codecs"), Bullets(lines)]
    return Document(title, tuple(parts))
