from meshreel.formats.notes import listed, note_left_out


def test_note_is_added_once_when_the_same_is_left_out_twice():
    notes = ["read at 24 frames per second"]
    note_left_out(notes, "lights: key, rim")
    note_left_out(notes, "lights: key, rim")
    assert notes == ["read at 24 frames per second", "left out: lights: key, rim"]


def test_names_are_counted_when_there_are_more_than_are_listed():
    assert listed("abc", most=3) == "a, b, c"
    assert listed("abcde", most=3) == "a, b, c and 2 more"
