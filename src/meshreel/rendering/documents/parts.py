"""The parts of a report."""

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
    """A bulleted list."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """A table; the first column is text, the others are numbers."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A PNG image of `n_panels` pictures or diagrams, with a title such as "Fig. 2"."""

    path: Path
    title: str
    caption: str
    n_panels: int


@dataclass(frozen=True)
class Drawing:
    """An ``<svg>`` element; HTML only."""

    svg: str
    title: str
    caption: str


Part = Heading | Paragraph | Code | Bullets | Table | Picture


@dataclass(frozen=True)
class Document:
    """A report and the title of its HTML page."""

    title: str
    parts: tuple[Part, ...]
