import json

import pytest

from meshreel.errors import InvalidInputError
from meshreel.evaluation.runs.store import MARKER, Store, claim_folder, file_name, sequence_identity
from meshreel.sequence import MeshSequence
from samples.meshes import waving_grid


def test_folder_is_made_and_marked_when_it_is_new(tmp_path):
    claim_folder(tmp_path / "a" / "b", "meshreel paper")
    facts = json.loads((tmp_path / "a" / "b" / MARKER).read_text())
    assert facts["command"] == "meshreel paper"


def test_folder_is_taken_again_when_it_is_marked(tmp_path):
    claim_folder(tmp_path, "first")
    (tmp_path / "report.md").write_text("old")
    claim_folder(tmp_path, "second")
    assert json.loads((tmp_path / MARKER).read_text())["command"] == "second"


@pytest.mark.parametrize("marker", [None, "", "[]", '{"made_by": "another"}'])
def test_folder_is_refused_and_kept_when_its_files_are_foreign(tmp_path, marker):
    (tmp_path / "thesis.txt").write_text("mine")
    if marker is not None:
        (tmp_path / MARKER).write_text(marker)
    before = sorted(path.name for path in tmp_path.iterdir())
    with pytest.raises(InvalidInputError, match=str(tmp_path)):
        claim_folder(tmp_path, "meshreel paper")
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_file_is_named_when_it_is_given_as_the_folder(tmp_path):
    (tmp_path / "report").write_text("")
    with pytest.raises(InvalidInputError, match="report is a file; name a folder"):
        claim_folder(tmp_path / "report", "meshreel paper")


@pytest.mark.parametrize(
    ("name", "expected"), [("samba", "samba"), ("a/../b c", "a-..-b-c"), ("../", "sequence")]
)
def test_names_become_parts_of_file_names_when_they_hold_other_letters(name, expected):
    assert file_name(name) == expected


def test_identity_differs_when_one_position_does():
    sequence = waving_grid()
    vertices = sequence.vertices.copy()
    vertices[3, 5, 1] += 1e-3
    other = MeshSequence(vertices, sequence.faces, sequence.fps, sequence.name)
    assert sequence_identity(other)["sha256"] != sequence_identity(sequence)["sha256"]
    assert sequence_identity(sequence) == sequence_identity(waving_grid())


def test_sequences_of_one_name_do_not_share_a_folder(tmp_path):
    sequence = waving_grid()
    other = MeshSequence(sequence.vertices * 2, sequence.faces, sequence.fps, sequence.name)
    stores = [Store.for_sequence(tmp_path, each) for each in (sequence, other)]
    assert stores[0].folder != stores[1].folder
