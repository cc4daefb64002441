"""How reports begin, and each of their sequences."""

from collections.abc import Iterable, Mapping
from typing import Any

from meshreel.evaluation.runs.machine import machines_text
from meshreel.rendering.documents.parts import Code, Heading, Paragraph, Part
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
