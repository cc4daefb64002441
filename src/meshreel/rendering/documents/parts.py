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
    title : str
        Such as "Fig. 2".
    n_panels : int
        How many pictures or diagrams it holds.
    """

    path: Path
    title: str
    caption: str
    n_panels: int


@dataclass(frozen=True)
class Drawing:
    """A drawing that only a page holds, not Markdown.

    Attributes
    ----------
    svg : str
        An element ``<svg>``.
    """

    svg: str
    title: str
    caption: str


Part = Heading | Paragraph | Code | Bullets | Table | Picture


@dataclass(frozen=True)
class Document:
    """A whole report; its title is that of the HTML page."""

    title: str
    parts: tuple[Part, ...]
