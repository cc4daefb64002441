"""A report as files: Markdown beside its pictures, and HTML that needs no other file."""

from collections.abc import Sequence
from pathlib import Path

from meshreel.evaluation.folder import write_text
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
