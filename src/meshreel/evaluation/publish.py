"""A report written as Markdown and as HTML."""

from collections.abc import Sequence
from pathlib import Path

from meshreel.evaluation.document import Part, to_markdown
from meshreel.evaluation.html import to_html
from meshreel.evaluation.store import write_text


def write_documents(parts: Sequence[Part], out: Path, title: str) -> tuple[Path, Path]:
    """Write report.md and report.html into the folder that holds the pictures; their paths."""
    markdown, html = out / "report.md", out / "report.html"
    write_text(markdown, to_markdown(parts, out))
    write_text(html, to_html(parts, title))
    return markdown, html
