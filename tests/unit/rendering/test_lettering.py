import pytest
from PIL import Image, ImageDraw

from meshreel.errors import InvalidInputError
from meshreel.rendering.lettering import draw_lines, font_of_size, spell_out, wrap_text

FONT = font_of_size(16)


@pytest.mark.parametrize(
    ("text", "spelled"),
    [
        ("10 \N{MICRO SIGN}m \N{MULTIPLICATION SIGN} 3°", "10 um x 3°"),
        ("±5 \N{EN DASH} 6 %", "±5 - 6 %"),
        ("é≤ü", "e<=u"),
        ("\u821e.ply", "?.ply"),
        ("plain", "plain"),
    ],
)
def test_spell_out_replaces_characters_that_the_font_lacks(text, spelled):
    assert spell_out(text) == spelled


def test_wrap_text_keeps_every_word_and_the_width():
    text = "one two three four five six seven eight nine ten"
    lines = wrap_text(text, FONT, 90)
    assert " ".join(lines) == text
    assert max(FONT.getlength(line) for line in lines) <= 90


def test_wrap_text_puts_too_wide_words_on_separate_lines():
    assert wrap_text("a incomprehensibilities b", FONT, 30) == ["a", "incomprehensibilities", "b"]


def test_wrap_text_of_empty_text_has_no_lines():
    assert wrap_text("", FONT, 90) == []


def test_draw_lines_rejects_an_unknown_alignment():
    canvas = ImageDraw.Draw(Image.new("RGB", (9, 9)))
    with pytest.raises(InvalidInputError, match="align"):
        draw_lines(canvas, (0, 0), ["a"], FONT, align="justify")
