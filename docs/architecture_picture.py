"""Count the lines of the folders in `docs/architecture.md`, and draw the page's picture.

    python docs/architecture_picture.py

Writes the last column of both tables and docs/images/architecture.svg. A test draws the picture
again and compares.
"""

import re
from itertools import groupby
from pathlib import Path
from textwrap import wrap
from xml.sax.saxutils import escape

DOCS = Path(__file__).parent
ROOT = DOCS.parent
PACKAGE = ROOT / "src" / "meshreel"
ROW = re.compile(r"^\| ([\w, ]+) \| `([\w./]+)` \| (.+) \| ([\d,]*) ?\|$", re.MULTILINE)
CODE = {".py", ".c", ".h", ".hpp", ".ts", ".mjs", ".cs", ".cpp", ".sh"}
"""Extensions of files whose lines count."""

WIDTH, MARGIN, GAP = 1000, 12, 10
LABEL_WIDTH, HEAD_HEIGHT, LINE_HEIGHT = 108, 46, 15
CHARACTER_WIDTH = 6.6
"""Mean width of a character of a purpose, in pixels."""

COLORS = {
    "pages, engines": "#ead9ea",
    "application": "#d6e4f0",
    "tools": "#e0ecdc",
    "codec": "#f7efc9",
    "base": "#f4e9d8",
    "C core": "#e4e4e4",
}
"""Fill color of each layer, top to bottom."""

HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" font-family="sans-serif">\n'
    '<rect width="{0}" height="{1}" fill="white"/>'
)

Module = tuple[str, str, str, str]
"""Layer, name, purpose and lines."""


def modules_of(page: str) -> list[Module]:
    """Modules in the table of the page, top to bottom."""
    return [row for row in ROW.findall(page) if row[0] in COLORS]


def picture(page: str) -> str:
    """The picture as SVG."""
    top, parts = MARGIN, list[str]()
    n_lines = {name: int(lines.replace(",", "")) for _, name, _, lines in modules_of(page)}
    for layer, rows in groupby(modules_of(page), key=lambda module: module[0]):
        modules = [module for module in rows if "." not in module[1] and "__" not in module[1]]
        width = (WIDTH - 2 * MARGIN - LABEL_WIDTH - (len(modules) - 1) * GAP) / len(modules)
        texts = [wrapped(purpose, width) for _, _, purpose, _ in modules]
        height = HEAD_HEIGHT + LINE_HEIGHT * max(map(len, texts))
        parts.append(
            f'<text x="{MARGIN}" y="{top + height / 2 + 5:.1f}" font-size="13" '
            f'fill="#5b6b7a">{layer}</text>'
        )
        for place, (module, lines) in enumerate(zip(modules, texts, strict=True)):
            left = MARGIN + LABEL_WIDTH + place * (width + GAP)
            name = module[1]
            total = sum(n for part, n in n_lines.items() if part.split(".")[0] == name)
            parts += _box(left, top, width, height, (*module[:3], f"{total:,}"), lines)
        top += height + GAP
    return "\n".join([HEAD.format(WIDTH, top - GAP + MARGIN), *parts, "</svg>", ""])


def wrapped(purpose: str, width: float) -> list[str]:
    """The lines of a purpose in a box of this width."""
    return wrap(purpose.replace("`", ""), int((width - 16) / CHARACTER_WIDTH))


def _box(
    left: float, top: float, width: float, height: float, module: Module, lines: list[str]
) -> list[str]:
    layer, name, _, n_lines = module
    return [
        f'<rect x="{left:.1f}" y="{top}" width="{width:.1f}" height="{height}" rx="5" '
        f'fill="{COLORS[layer]}" stroke="#5b6b7a"/>',
        f'<text x="{left + 8:.1f}" y="{top + 19}" font-size="15" font-weight="bold" '
        f'fill="#1d2a36">{name}</text>',
        f'<text x="{left + width - 8:.1f}" y="{top + height - 8}" font-size="11" '
        f'text-anchor="end" fill="#5b6b7a">{n_lines} lines</text>',
        *(
            f'<text x="{left + 8:.1f}" y="{top + 36 + number * LINE_HEIGHT}" font-size="12" '
            f'fill="#34424f">{escape(line)}</text>'
            for number, line in enumerate(lines)
        ),
    ]


def lines_of(name: str, counted_apart: list[str]) -> int:
    """Count the lines of code of a module or folder, without those that have rows of their own.

    Parameters
    ----------
    name : str
        Such as "formats", "paper.study" or "core/reader".
    counted_apart : list of str
        Names of all rows.
    """
    path = _path(name)
    apart = [_path(other) for other in counted_apart if _path(other) != path]
    apart = [other for other in apart if other.is_relative_to(path)]
    files = [path] if path.is_file() else path.rglob("*")
    return sum(
        len(file.read_text(encoding="utf-8").splitlines())
        for file in files
        if file.suffix in CODE
        and file.is_file()
        and not {"node_modules", "dist", "build"} & set(file.parts)
        and not any(file.is_relative_to(other) for other in apart)
    )


def _path(name: str) -> Path:
    for path in (PACKAGE / name.replace(".", "/"), PACKAGE / f"{name}.py", ROOT / name):
        if path.exists():
            return path
    raise FileNotFoundError(f"docs/architecture.md has a row for {name}, which does not exist")


def with_lines(page: str) -> str:
    """The page with the lines of every row, rounded to hundreds, so that it seldom changes."""
    names = [row[1] for row in ROW.findall(page)]

    def counted(row: re.Match[str]) -> str:
        n_lines = max(100, round(lines_of(row[2], names), -2))
        return f"| {row[1]} | `{row[2]}` | {row[3]} | {n_lines:,} |"

    return ROW.sub(counted, page)


if __name__ == "__main__":
    path = DOCS / "architecture.md"
    page = with_lines(path.read_text(encoding="utf-8"))
    path.write_text(page, encoding="utf-8")
    (DOCS / "images" / "architecture.svg").write_text(picture(page), encoding="utf-8")
