"""A report as a list of parts, and as Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Heading:
    """A heading of level 1, 2 or 3."""

    level: int
    text: str


@dataclass(frozen=True)
class Paragraph:
    """Text; `code` in backticks."""

    text: str


@dataclass(frozen=True)
class Code:
    """A block of code."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of texts."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """A table; the first column is text, the others are figures."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A PNG file with what it shows.

    Attributes
    ----------
    path : Path
    title : str
        Such as "Fig. 2".
    caption : str
    n_panels : int
        How many pictures or diagrams it holds.
    """

    path: Path
    title: str
    caption: str
    n_panels: int


Part = Heading | Paragraph | Code | Bullets | Table | Picture


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
