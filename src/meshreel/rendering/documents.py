"""Reports: their parts in words, tables and pictures, and self-contained HTML files."""

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

NONE = "-"

_UNIT = re.compile(r"(?<=\d) (?=(?:%|x|s|dB|[kMG]?B)(?!\w))")
"""The space between a number and its unit, where a line must not break."""

_STYLE = """
body { font: 16px/1.55 system-ui, sans-serif; color: #22262e; max-width: 72rem; margin: 2rem auto;
  padding: 0 1.2rem; overflow-wrap: break-word; }
h1, h2, h3 { line-height: 1.25; margin: 2.2em 0 0.6em; }
h1 { margin-top: 0; font-size: clamp(1.5rem, 6vw, 2rem); }
p, li { max-width: 48rem; } ul { padding-left: 1.4rem; }
code, pre { font-family: ui-monospace, monospace; font-size: 0.92em; }
pre span, p code, li code, figcaption code { display: inline-block; max-width: 100%; }
pre { background: #f3f4f7; padding: 0.8rem 1rem; white-space: pre-wrap; }
.scroll { overflow-x: auto; margin: 1rem 0; background:
  linear-gradient(to left, #fff 50%, #fff0) right / 2rem 100% no-repeat local,
  linear-gradient(to left, #0003, #0000) right / 0.7rem 100% no-repeat; }
table { border-collapse: collapse; font-size: 0.88rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: 0.4rem 0; }
caption span { display: inline-block; position: sticky; left: 0; max-width: calc(100vw - 2.4rem); }
th, td { padding: 0.3rem 0.7rem; border-bottom: 1px solid #dde0e6; text-align: right; }
th:first-child, td:first-child { text-align: left; white-space: nowrap; }
th { vertical-align: bottom; }
figure { margin: 1.6rem 0; } img, svg { display: block; max-width: 100%; height: auto; }
figcaption { font-size: 0.92rem; color: #5c6370; max-width: 48rem; }
@media (max-width: 48rem) {
  table { width: max-content; } th { max-width: 7rem; } td { white-space: nowrap; }
  th:first-child, td:first-child { position: sticky; left: 0; background: #fff;
    white-space: normal; max-width: 9rem; }
}
""".strip()


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


def to_html(parts: Sequence[Part | Drawing], title: str, generator: str = "meshreel") -> str:
    """The report as HTML with embedded pictures and style; `generator` is the command line."""
    body = "\n".join(_html(part) for part in parts)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="generator" content="{escape(generator)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n"
        f"<style>\n{_STYLE}\n</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def _html(part: Part | Drawing) -> str:
    match part:
        case Heading(level, text):
            return f"<h{level}>{_inline(text)}</h{level}>"
        case Paragraph(text):
            return f"<p>{_inline(text)}</p>"
        case Code(text):
            # Lines break between words, and not after hyphens of options.
            words = re.sub(r"\S*-\S*", r"<span>\g<0></span>", escape(text))
            return f"<pre><code>{words}</code></pre>"
        case Bullets(items):
            return f"<ul>{''.join(f'<li>{_inline(item)}</li>' for item in items)}</ul>"
        case Table():
            return _table(part)
        case Drawing(svg, title, caption):
            return _figure(svg, title, caption)
        case Picture(path, title, caption):
            png = path.read_bytes()
            data = base64.b64encode(png).decode("ascii")
            image = (
                f'<img alt="{escape(title)}" style="min-width: {_legible_width_px(png)}px" '
                f'src="data:image/png;base64,{data}">'
            )
            return _figure(image, title, caption)


def _figure(picture: str, title: str, caption: str) -> str:
    return (
        f'<figure><div class="scroll">{picture}</div>'
        f"<figcaption><strong>{escape(title)}.</strong> {_inline(caption)}</figcaption></figure>"
    )


def _legible_width_px(png: bytes) -> int:
    """Width of an image at which text of 8 points is 8 CSS pixels high; 0 without a resolution."""
    at = png.find(b"pHYs", 0, 1024)
    if at < 0:
        return 0
    width, per_meter = (int.from_bytes(png[i : i + 4], "big") for i in (16, at + 4))
    return round(72 * width / (0.0254 * per_meter))


def _table(table: Table) -> str:
    header = "".join(f"<th>{_inline(cell)}</th>" for cell in table.header)
    rows = "".join(
        f"<tr>{''.join(f'<td>{_inline(cell)}</td>' for cell in row)}</tr>" for row in table.rows
    )
    title = f"<caption><span>{_inline(table.title)}</span></caption>" if table.title else ""
    return (
        f'<div class="scroll"><table>{title}'
        f"<thead><tr>{header}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _inline(text: str) -> str:
    """Escaped text with `code` and **strong** marked up, and units kept at their numbers."""
    escaped = _UNIT.sub("\N{NO-BREAK SPACE}", escape(text, quote=False))
    marked = re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)
    return re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", marked)
