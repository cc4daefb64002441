"""Tables as lines of text."""

import unicodedata
from collections.abc import Iterator, Sequence
from itertools import zip_longest

Row = Sequence[Sequence[str]]
"""The lines of each cell."""


def table_lines(rows: Sequence[Row], headings: Sequence[str] = ()) -> Iterator[str]:
    """Lines of a table; with headings, columns after the first are aligned to the right."""
    table = [*([[[heading] for heading in headings]] if headings else []), *rows]
    widths = [
        max((text_width(line) for cell in column for line in cell), default=0)
        for column in zip(*table, strict=True)
    ]
    for row in table:
        for pieces in zip_longest(*row, fillvalue=""):
            padded = []
            for number, (piece, width) in enumerate(zip(pieces, widths, strict=True)):
                space = " " * (width - text_width(piece))
                padded.append(space + piece if headings and number else piece + space)
            yield "  ".join(padded).rstrip()


def text_width(text: str) -> int:
    """Number of terminal columns that the text occupies."""
    if text.isascii():
        return len(text)
    return sum(
        0 if unicodedata.combining(letter) else 1 + (unicodedata.east_asian_width(letter) in "WF")
        for letter in text
    )
