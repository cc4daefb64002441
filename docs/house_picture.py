"""The picture of the house, drawn from the table of `docs/house.md`.

    python docs/house_picture.py

Writes docs/images/house.svg. A test draws it again and compares.
"""

import re
from itertools import groupby
from pathlib import Path
from textwrap import wrap
from xml.sax.saxutils import escape

DOCS = Path(__file__).parent
ROW = re.compile(r"^\| (\d+) \| `([a-z_]+)` \| (.+) \|$", re.MULTILINE)

WIDTH, MARGIN, GAP = 1000, 12, 8
ROOM_HEIGHT, LINE_HEIGHT = 64, 15
CHARACTER = 6.0
"""Mean width of a character of a purpose, in pixels."""

ROOF, CELLAR = (214, 228, 240), (244, 233, 216)
"""Colours of the highest and of the lowest floor."""

HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" font-family="sans-serif">\n'
    '<rect width="{0}" height="{1}" fill="white"/>'
)


def rooms_of(page: str) -> list[tuple[int, str, str]]:
    """Floor, name and purpose of each room in the table of the page."""
    return [(int(floor), name, purpose) for floor, name, purpose in ROW.findall(page)]


def picture(page: str) -> str:
    """The picture as SVG."""
    floors = [list(rooms) for _, rooms in groupby(rooms_of(page), key=lambda room: room[0])]
    height = 2 * MARGIN + len(floors) * (ROOM_HEIGHT + GAP) - GAP
    parts = [HEAD.format(WIDTH, height)]
    for row, rooms in enumerate(floors):
        top = MARGIN + row * (ROOM_HEIGHT + GAP)
        color = _mixed(row / (len(floors) - 1))
        width = (WIDTH - 2 * MARGIN - (len(rooms) - 1) * GAP) / len(rooms)
        for place, (_, name, purpose) in enumerate(rooms):
            parts += _room(MARGIN + place * (width + GAP), top, width, color, name, purpose)
    return "\n".join([*parts, "</svg>", ""])


def _room(left: float, top: float, width: float, color: str, name: str, purpose: str) -> list[str]:
    lines = wrap(purpose.replace("`", ""), int((width - 20) / CHARACTER))
    if len(lines) > 2:
        lines = [lines[0], lines[1].rsplit(" ", 1)[0].rstrip(",;:") + " ..."]
    return [
        f'<rect x="{left:.1f}" y="{top}" width="{width:.1f}" height="{ROOM_HEIGHT}" rx="5" '
        f'fill="{color}" stroke="#5b6b7a"/>',
        f'<text x="{left + 10:.1f}" y="{top + 20}" font-size="15" font-weight="bold" '
        f'fill="#1d2a36">{name}</text>',
        *(
            f'<text x="{left + 10:.1f}" y="{top + 38 + number * LINE_HEIGHT}" font-size="12" '
            f'fill="#34424f">{escape(line)}</text>'
            for number, line in enumerate(lines)
        ),
    ]


def _mixed(share: float) -> str:
    mixed = (round(a + share * (b - a)) for a, b in zip(ROOF, CELLAR, strict=True))
    return "#" + "".join(f"{part:02x}" for part in mixed)


if __name__ == "__main__":
    page = (DOCS / "house.md").read_text(encoding="utf-8")
    (DOCS / "images" / "house.svg").write_text(picture(page), encoding="utf-8")
