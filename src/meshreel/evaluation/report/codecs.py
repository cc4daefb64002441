"""The frame of reports on our codec beside others."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

from meshreel.evaluation.report.openings import report_opening
from meshreel.rendering.documents.parts import Bullets, Document, Heading, Part


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
