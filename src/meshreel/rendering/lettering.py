"""Text in pictures: font, line breaks, drawing."""

import unicodedata

from PIL import ImageDraw, ImageFont

from meshreel.errors import InvalidInputError

Font = ImageFont.ImageFont | ImageFont.FreeTypeFont
Ink = tuple[int, int, int]

INK: Ink = (34, 38, 46)

_LINE_SPACING = 1.3
_SPELLINGS = {
    "\N{MULTIPLICATION SIGN}": "x",
    "\N{MICRO SIGN}": "u",
    "\N{GREEK SMALL LETTER MU}": "u",
    "\N{EN DASH}": "-",
    "\N{EM DASH}": "-",
    "\N{MINUS SIGN}": "-",
    "≤": "<=",
    "≥": ">=",
}
_SUPPORTED_SIGNS = "°±"


def font_of_size(height_px: float) -> Font:
    """The font of all labels, about `height_px` pixels high including descenders."""
    return ImageFont.load_default(size=height_px)


def spell_out(text: str) -> str:
    """Replace characters that the font lacks: signs by ASCII, accents removed, others by '?'."""
    spelled = "".join(_SPELLINGS.get(letter, letter) for letter in text)
    letters = unicodedata.normalize("NFKD", spelled)
    return "".join(
        letter if letter.isascii() or letter in _SUPPORTED_SIGNS else "?"
        for letter in letters
        if not unicodedata.combining(letter)
    )


def wrap_text(text: str, font: Font, width_px: float) -> list[str]:
    """Break spelled-out text into lines of at most `width_px`; longer words exceed it."""
    lines: list[str] = []
    for paragraph in spell_out(text).splitlines():
        line = ""
        for word in paragraph.split():
            candidate = f"{line} {word}" if line else word
            if line and font.getlength(candidate) > width_px:
                lines.append(line)
                candidate = word
            line = candidate
        lines.append(line)
    return lines


def line_height_px(font: Font) -> int:
    """Distance between baselines."""
    _, top, _, bottom = font.getbbox("Agjpqy|")
    return round((bottom - top) * _LINE_SPACING)


def draw_lines(
    canvas: ImageDraw.ImageDraw,
    position: tuple[float, float],
    lines: list[str],
    font: Font,
    *,
    ink: Ink = INK,
    align: str = "left",
) -> None:
    """Draw lines of text below `position`, their upper left corner or upper center.

    Raises
    ------
    InvalidInputError
        If `align` is not "left" or "center".
    """
    anchors = {"left": "la", "center": "ma"}
    if align not in anchors:
        raise InvalidInputError(f"align must be one of {list(anchors)}; got {align!r}")
    for number, line in enumerate(lines):
        y = position[1] + number * line_height_px(font)
        canvas.text((position[0], y), line, font=font, fill=ink, anchor=anchors[align])
