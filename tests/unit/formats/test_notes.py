from meshreel.formats.notes import GatheredNote, listed, note_left_out


def test_note_is_added_once_when_the_same_is_left_out_twice():
    notes = ["read at 24 frames per second"]
    note_left_out(notes, "lights: key, rim")
    note_left_out(notes, "lights: key, rim")
    assert notes == ["read at 24 frames per second", "left out: lights: key, rim"]


def test_names_are_counted_when_there_are_more_than_are_listed():
    assert listed("abc", most=3) == "a, b, c"
    assert listed("abcde", most=3) == "a, b, c and 2 more"


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
