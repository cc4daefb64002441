"""The parts that a report is a list of."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshreel.counting import counted


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
