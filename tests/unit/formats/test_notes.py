import pickle

from meshreel.errors import Keyword, Message
from meshreel.formats.notes import (
    Note,
    NoteKind,
    add_note,
    combined,
    is_about,
    is_of_kind,
    list_in_note,
    listed,
    note_kinds,
    note_left_out,
)


def test_note_on_something_left_out_is_added_once():
    notes = ["read at 24 frames per second"]
    note_left_out(notes, "lights: key, rim")
    note_left_out(notes, "lights: key, rim")
    assert notes == ["read at 24 frames per second", "left out: lights: key, rim"]


def test_long_lists_end_with_a_count():
    assert listed("abc", most=3) == "a, b, c"
    assert listed("abcde", most=3) == "a, b, c and 2 more"


def test_note_lists_further_names_in_its_place():
    notes = ["before"]
    note_kinds(notes, "curves", ["a"])
    notes.append("between")
    note_kinds(notes, "curves", ["b", "a"])
    list_in_note(notes, NoteKind.CHANGED, "curves", [])
    assert notes == ["before", "left out: curves: a, b", "between"]


def test_note_knows_kind_and_subject_after_pickling():
    note = pickle.loads(pickle.dumps(Note(NoteKind.LEFT_OUT, "curves", ["/a", "/b"])))
    assert note == "left out: curves: /a, /b"
    assert (note.kind, note.contents) == (NoteKind.LEFT_OUT, "curves: /a, /b")
    assert is_of_kind(note, NoteKind.LEFT_OUT)
    assert is_about(note, "curves")
    assert not is_about(str(note), "curves")


def test_note_knows_its_keywords_after_pickling():
    text = Message("read as 24 fps; set another with ", Keyword("fps"))
    note = pickle.loads(pickle.dumps(Note(NoteKind.UNKNOWN, "frame rate", text=text)))
    assert note == "read as 24 fps; set another with fps"
    assert note.naming(lambda keyword: f"--{keyword.name}") == text[:-3] + "--fps"


def test_notes_of_several_segments_become_one_when_only_details_differ(notes):
    for count in (3, 4):
        add_note(notes, NoteKind.CHANGED, "hard edges", f"kept {count} hard edges")
        add_note(notes, NoteKind.LEFT_OUT, "normals")
    assert combined([*notes, "plain", "plain"]) == [
        "kept 3 hard edges; other segments similarly",
        "left out: normals",
        "plain",
    ]
