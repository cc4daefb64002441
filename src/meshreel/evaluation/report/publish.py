"""What reports have in common: how a sequence is introduced, and the files they become."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from meshreel.counting import counted
from meshreel.evaluation.report.document import Heading, Paragraph, Part, to_markdown
from meshreel.evaluation.report.html import to_html
from meshreel.evaluation.runs.store import write_text


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


def write_documents(parts: Sequence[Part], out: Path, title: str) -> tuple[Path, Path]:
    """Write report.md and report.html into the folder that holds the pictures; their paths."""
    markdown, html = out / "report.md", out / "report.html"
    write_text(markdown, to_markdown(parts, out))
    write_text(html, to_html(parts, title))
    return markdown, html
