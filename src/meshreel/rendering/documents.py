"""Reports in Markdown: their tables, pictures and lists, and numbers in them."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

NONE = "-"


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


Part = str | Table | Picture
"""Markdown, or what becomes Markdown in a report."""


def bullets(items: Iterable[str]) -> str:
    """A bulleted list in Markdown."""
    return "\n".join(f"- {item}" for item in items)


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
