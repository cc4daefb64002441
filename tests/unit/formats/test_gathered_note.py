"""A sentence that grows with what is named to it."""

from meshreel.formats.gathered_note import GatheredNote


def test_gathered_note_is_one_sentence_when_things_are_named_one_by_one():
    notes = ["before"]
    found = GatheredNote(notes, lambda names: f"all of {', '.join(names)}")
    found.add("a")
    notes.append("between")
    found.add("b")
    found.add("a")
    assert notes == ["before", "between", "all of a, b"]


def test_gathered_note_says_nothing_when_nothing_is_named():
    notes = []
    GatheredNote(notes, ", ".join)
    assert notes == []
