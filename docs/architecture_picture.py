"""Draw the picture of `docs/architecture.md` from its table of modules.

    python docs/architecture_picture.py

Writes docs/images/architecture.svg. A test draws it again and compares.
"""

import re
from itertools import groupby
from pathlib import Path
from textwrap import wrap
from xml.sax.saxutils import escape

DOCS = Path(__file__).parent
ROW = re.compile(r"^\| (\w+) \| `([a-z_.]+)` \| (.+) \|$", re.MULTILINE)

WIDTH, MARGIN, GAP = 1000, 12, 10
LABEL_WIDTH, BOX_HEIGHT, LINE_HEIGHT = 110, 84, 15
CHARACTER_WIDTH = 6.2
"""Mean width of a character of a purpose, in pixels."""

COLORS = {"application": "#d6e4f0", "tools": "#e0ecdc", "codec": "#f7efc9", "base": "#f4e9d8"}
"""Fill color of each layer."""

HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" font-family="sans-serif">\n'
    '<rect width="{0}" height="{1}" fill="white"/>'
)


def modules_of(page: str) -> list[tuple[str, str, str]]:
    """Layer, name and purpose of each module in the table of the page, top to bottom."""
    return [row for row in ROW.findall(page) if row[0] in COLORS]


def picture(page: str) -> str:
    """The picture as SVG."""
    layers = [
        (name, [module for module in modules if module[1].isalpha()])
        for name, modules in groupby(modules_of(page), key=lambda module: module[0])
    ]
    parts = [HEAD.format(WIDTH, 2 * MARGIN + len(layers) * (BOX_HEIGHT + GAP) - GAP)]
    for row, (layer, modules) in enumerate(layers):
        top = MARGIN + row * (BOX_HEIGHT + GAP)
        parts.append(
            f'<text x="{MARGIN}" y="{top + BOX_HEIGHT / 2 + 5:.1f}" font-size="15" '
            f'fill="#5b6b7a">{layer}</text>'
        )
        left = MARGIN + LABEL_WIDTH
        width = (WIDTH - MARGIN - left - (len(modules) - 1) * GAP) / len(modules)
        for place, (_, name, purpose) in enumerate(modules):
            parts += _box(left + place * (width + GAP), top, width, COLORS[layer], name, purpose)
    return "\n".join([*parts, "</svg>", ""])


def _box(left: float, top: float, width: float, color: str, name: str, purpose: str) -> list[str]:
    lines = wrap(purpose.replace("`", ""), int((width - 20) / CHARACTER_WIDTH))
    return [
        f'<rect x="{left:.1f}" y="{top}" width="{width:.1f}" height="{BOX_HEIGHT}" rx="5" '
        f'fill="{color}" stroke="#5b6b7a"/>',
        f'<text x="{left + 10:.1f}" y="{top + 20}" font-size="15" font-weight="bold" '
        f'fill="#1d2a36">{name}</text>',
        *(
            f'<text x="{left + 10:.1f}" y="{top + 38 + number * LINE_HEIGHT}" font-size="12" '
            f'fill="#34424f">{escape(line)}</text>'
            for number, line in enumerate(lines)
        ),
    ]


if __name__ == "__main__":
    page = (DOCS / "architecture.md").read_text(encoding="utf-8")
    (DOCS / "images" / "architecture.svg").write_text(picture(page), encoding="utf-8")
