"""Things and their number in words."""

import pytest

from meshreel.counting import counted, plural, singular

NOUNS = ["frame", "vertex", "mesh", "morph target", "face", "entry"]


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
def test_noun_stands_in_the_plural_when_there_is_not_one(number, noun, words):
    assert counted(number, noun) == words


@pytest.mark.parametrize("noun", NOUNS)
def test_noun_comes_back_when_its_plural_is_undone(noun):
    assert singular(plural(noun)) == noun
