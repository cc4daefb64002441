import json

import pytest

from meshreel.errors import InvalidInputError
from meshreel.evaluation.folder import claim_folder, file_name

PROGRAM, MARKER = "meshreel paper", "meshreel-paper.json"


def test_folder_is_made_and_marked_when_it_is_new(tmp_path):
    claim_folder(tmp_path / "a" / "b", PROGRAM, "meshreel paper")
    facts = json.loads((tmp_path / "a" / "b" / MARKER).read_text())
    assert facts["command"] == "meshreel paper"


def test_folder_is_taken_again_when_it_is_marked(tmp_path):
    claim_folder(tmp_path, PROGRAM, "first")
    (tmp_path / "report.md").write_text("old")
    claim_folder(tmp_path, PROGRAM, "second")
    assert json.loads((tmp_path / MARKER).read_text())["command"] == "second"


@pytest.mark.parametrize("marker", [None, "", "[]", '{"made_by": "another"}'])
def test_folder_is_refused_and_kept_when_its_files_are_foreign(tmp_path, marker):
    (tmp_path / "thesis.txt").write_text("mine")
    if marker is not None:
        (tmp_path / MARKER).write_text(marker)
    before = sorted(path.name for path in tmp_path.iterdir())
    with pytest.raises(InvalidInputError, match=str(tmp_path)):
        claim_folder(tmp_path, PROGRAM, "meshreel paper x.npz")
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_file_is_named_when_it_is_given_as_the_folder(tmp_path):
    (tmp_path / "report").write_text("")
    with pytest.raises(InvalidInputError, match="report is a file; name a folder"):
        claim_folder(tmp_path / "report", PROGRAM, "meshreel paper")


@pytest.mark.parametrize(
    ("name", "expected"), [("samba", "samba"), ("a/../b c", "a-..-b-c"), ("../", "sequence")]
)
def test_names_become_parts_of_file_names_when_they_hold_other_letters(name, expected):
    assert file_name(name) == expected
