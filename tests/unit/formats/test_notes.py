from meshreel.formats.notes import GatheredNote, listed, note_left_out


def test_note_on_something_left_out_is_added_once():
    notes = ["read at 24 frames per second"]
    note_left_out(notes, "lights: key, rim")
    note_left_out(notes, "lights: key, rim")
    assert notes == ["read at 24 frames per second", "left out: lights: key, rim"]


def test_long_lists_end_with_a_count():
    assert listed("abc", most=3) == "a, b, c"
    assert listed("abcde", most=3) == "a, b, c and 2 more"


def test_gathered_note_grows_in_one_sentence():
    notes = ["before"]
    found = GatheredNote(notes, lambda names: f"all of {', '.join(names)}")
    found.add("a")
    notes.append("between")
    found.add("b")
    found.add("a")
    assert notes == ["before", "between", "all of a, b"]


def test_gathered_note_without_names_adds_nothing():
    notes = []
    GatheredNote(notes, ", ".join)
    assert notes == []
