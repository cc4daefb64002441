"""Reports: their parts in words, tables and pictures, and numbers in them."""

from dataclasses import dataclass
from pathlib import Path

NONE = "-"


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


Part = Heading | Paragraph | Code | Bullets | Table | Picture


def number(value: float | None) -> str:
    """Four decimals, as the paper prints rates."""
    return NONE if value is None else f"{value:.4f}"


def significant(value: float | None) -> str:
    """Three significant digits, never with an exponent."""
    if value is None:
        return NONE
    if value == 0:
        return "0"
    text = f"{value:.3g}"
    if abs(value) >= 1000:
        return f"{float(text):.0f}"
    return f"{float(text):.12f}".rstrip("0").rstrip(".") if "e" in text else text


def scientific(value: float | None) -> str:
    """Three significant digits with an exponent."""
    return NONE if value is None else f"{value:.2e}"
