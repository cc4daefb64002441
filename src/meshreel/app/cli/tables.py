"""Tables and bars as lines of text."""

import textwrap
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest

BORDERS = ("┌┬┐", "├┼┤", "└┴┘", "─", "│")
ASCII_BORDERS = ("+++", "+++", "+++", "-", "|")
"""Left, inner and right ends of the rules at the top, middle and bottom; dash; bar."""

_EIGHTHS = " ▏▎▍▌▋▊▉█"

Row = Sequence[Sequence[str]]
"""The lines of each cell."""


def table_lines(
    rows: Iterable[Row], headings: Sequence[str] = (), *, width: int, ascii_only: bool = False
) -> list[str]:
    """Lines of a table with borders.

    The first column is aligned to the left, others to the right.

    Parameters
    ----------
    rows : iterable of rows
    headings : sequence of str
        One for each column, or none.
    width : int
        Largest width in columns of the terminal; cells are wrapped to fit it.
    ascii_only : bool
        Whether the borders are ASCII characters.
    """
    rows = list(rows)
    head: list[Row] = [[[heading] for heading in headings]] if headings else []
    natural = [
        max((text_width(line) for cell in column for line in cell), default=0)
        for column in zip(*head, *rows, strict=True)
    ]
    widths = _fitted(natural, width - 3 * len(natural) - 1)
    top, middle, bottom, dash, bar = ASCII_BORDERS if ascii_only else BORDERS

    def rule(ends: str) -> str:
        return ends[0] + ends[1].join(dash * (one + 2) for one in widths) + ends[2]

    above = [rule(top), *(line for row in head for line in _row_lines(row, widths, bar))]
    if headings:
        above.append(rule(middle))
    return [*above, *(line for row in rows for line in _row_lines(row, widths, bar)), rule(bottom)]


def _fitted(widths: Sequence[int], available: int) -> list[int]:
    """Widths of columns with this sum, if possible: the widest ones are reduced."""
    limit = max(widths, default=1)
    while sum(min(one, limit) for one in widths) > available and limit > 1:
        limit -= 1
    fitted = [min(one, limit) for one in widths]
    for number, one in enumerate(widths):  # the limit reduces all of the widest by one
        fitted[number] += min(one - fitted[number], max(available - sum(fitted), 0))
    return fitted


def _row_lines(row: Row, widths: Sequence[int], bar: str) -> Iterator[str]:
    wrapped = [
        [piece for line in cell for piece in _wrapped(line, width)]
        for cell, width in zip(row, widths, strict=True)
    ]
    for pieces in zip_longest(*wrapped, fillvalue=""):
        padded = []
        for number, (piece, width) in enumerate(zip(pieces, widths, strict=True)):
            space = " " * (width - text_width(piece))
            padded.append(f" {space}{piece} " if number else f" {piece}{space} ")
        yield bar + bar.join(padded) + bar


def _wrapped(line: str, width: int) -> list[str]:
    if text_width(line) <= width:
        return [line]
    if text_width(line) > len(line):  # characters may take two columns
        width = max(width // 2, 1)
    return textwrap.wrap(line, width, break_on_hyphens=False)


def text_width(text: str) -> int:
    """Columns of a terminal that the text takes."""
    if text.isascii():
        return len(text)
    return sum(
        0 if unicodedata.combining(letter) else 1 + (unicodedata.east_asian_width(letter) in "WF")
        for letter in text
    )


def text_bar(share: float, width: int, *, ascii_only: bool = False) -> str:
    """A bar over a share of a width in columns, in eighths of a column unless `ascii_only`.

    Shares above 0 are always visible.
    """
    if ascii_only:
        return "#" * max(round(share * width), 1 if share > 0 else 0)
    eighths = max(round(8 * share * width), 1 if share > 0 else 0)
    whole, rest = divmod(eighths, 8)
    return _EIGHTHS[8] * whole + (_EIGHTHS[rest] if rest else "")
