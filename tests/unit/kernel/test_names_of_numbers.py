"""Kinds and domains have the same names and numbers in Python, TypeScript and C, thus in C#."""

import re
from pathlib import Path

import pytest

from meshreel.codec.surface.codes import DOMAINS, KINDS
from meshreel.model.tracks import KIND_ROWS

ROOT = Path(__file__).parents[3]
SINGULARS = {"VERTICES": "vertex", "FACES": "face", "CORNERS": "corner", "CELLS": "cell"}


def entries(path, begin, entry, end="}"):
    """Return the groups of each entry of an enumeration in a source."""
    body = (ROOT / path).read_text("utf-8").split(begin, 1)[1].split(end, 1)[0]
    return re.findall(entry, body)


@pytest.mark.parametrize(
    ("numbers", "name", "prefix", "in_typescript"),
    [
        ({kind.value: row.code for kind, row in KIND_ROWS.items()}, "meshreel_track_kind",
         "MESHREEL_TRACK_", "track_kinds.ts const KINDS"),
        ({kind.value: number for number, kind in enumerate(KINDS)}, "meshreel_attribute_kind",
         "MESHREEL_", "core/surface.ts const KINDS"),
        ({domain.value: number for number, domain in enumerate(DOMAINS)}, "meshreel_domain",
         "MESHREEL_", "core/file.ts const DOMAINS"),
    ],
)  # fmt: skip
def test_numbers_are_the_same_everywhere(numbers, name, prefix, in_typescript):
    in_c = entries("core/include/meshreel.h", f"enum {name} {{", rf"{prefix}(\w+) = (\d+)")
    assert {SINGULARS.get(word, word.lower()): int(number) for word, number in in_c} == numbers
    file, begin = in_typescript.split(" ", 1)
    names = entries(f"npm/src/{file}", f"{begin} = [", r'"(\w+)"', "]")
    assert {word: number for number, word in enumerate(names)} == numbers
