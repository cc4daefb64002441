"""The example, the constants and the length of docs/format.md."""

import re
from pathlib import Path

from conformance.example import example_lines
from conformance.hierarchy import LARGE_COEFFICIENTS, SMALL_COEFFICIENTS
from conformance.make import FOLDER

PAGE = (Path(__file__).parents[2] / "docs" / "format.md").read_text("utf-8")
MAX_LINES = 455


def test_example_of_the_page_is_the_stored_stream():
    shown = PAGE[PAGE.index("## A stream in bytes") :]
    shown = shown.partition("```text\n")[2].partition("\n```")[0]
    assert shown.split("\n") == example_lines((FOLDER / "example.reel").read_bytes())


def test_constants_of_the_page_are_those_of_the_plain_reader():
    numbers = list(map(float.fromhex, re.findall(r"0x1\.\w+p-\d+", PAGE)))
    assert numbers == SMALL_COEFFICIENTS + LARGE_COEFFICIENTS


def test_page_is_short():
    assert len(PAGE.splitlines()) < MAX_LINES
