"""Counted nouns and sizes as text."""

import pytest

from meshreel.runtime.counting import (
    change_text,
    counted,
    duration_text,
    plural,
    singular,
    size_text,
)

NOUNS = ["frame", "vertex", "mesh", "morph target", "face", "entry", "frequency"]


@pytest.mark.parametrize(
    ("number", "noun", "words"),
    [
        (1, "frame", "1 frame"),
        (0, "frame", "0 frames"),
        (2, "vertex", "2 vertices"),
        (1, "mesh", "1 mesh"),
        (5, "morph target", "5 morph targets"),
    ],
)
def test_noun_is_plural_unless_the_number_is_one(number, noun, words):
    assert counted(number, noun) == words


@pytest.mark.parametrize("noun", NOUNS)
def test_singular_inverts_plural(noun):
    assert singular(plural(noun)) == noun


@pytest.mark.parametrize(
    ("size_bytes", "text"),
    [(0, "0 B"), (999, "999 B"), (1000, "1 kB"), (1234567, "1.23 MB"), (999_499, "999 kB"),
     (999_500, "1 MB"), (5.6e9, "5.6 GB"), (7e12, "7 TB")],
)  # fmt: skip
def test_sizes_use_the_unit_with_the_fewest_digits(size_bytes, text):
    assert size_text(size_bytes) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (119, "119 s"), (150, "2 minutes"), (7000, "117 minutes"), (9e4, "25 hours")],
)
def test_durations_have_a_unit_that_fits(seconds, text):
    assert duration_text(seconds) == text


@pytest.mark.parametrize(
    ("before", "after", "text"),
    [
        (460, 100, "4.6 x smaller"),
        (100, 100, "1.0 x smaller"),
        (90, 180, "2.0 x larger"),
        (0, 40, "0.0 x smaller"),
    ],
)
def test_change_is_smaller_or_larger(before, after, text):
    assert change_text(before, after) == text
