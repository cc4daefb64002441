"""Folders, names and documents of studies."""

import json

import pytest

from meshreel.errors import InvalidInputError
from meshreel.rendering.documents import Table, to_html
from meshreel.studies.runs import file_name
from meshreel.studies.study import checked_names, claim_folder, to_markdown

KNOWN = ("pca", "v2v", "gft")
PROGRAM, MARKER = "meshreel paper", "meshreel-paper.json"


def test_names_are_returned_in_the_order_of_known_names():
    assert checked_names(["gft", "pca", "gft"], KNOWN, "method") == ("pca", "gft")


@pytest.mark.parametrize(
    ("names", "problem"),
    [(["pcaqp"], "method 'pcaqp' is unknown"), ([], "name at least one method")],
)
def test_error_for_an_unknown_or_missing_name_lists_the_names(names, problem):
    with pytest.raises(InvalidInputError, match=f"{problem}; choose from pca, v2v, gft"):
        checked_names(names, KNOWN, "method")


def test_new_folder_is_created_and_marked(tmp_path):
    claim_folder(tmp_path / "a" / "b", PROGRAM, "meshreel paper")
    facts = json.loads((tmp_path / "a" / "b" / MARKER).read_text())
    assert facts["command"] == "meshreel paper"


def test_marked_folder_is_reused(tmp_path):
    claim_folder(tmp_path, PROGRAM, "first")
    (tmp_path / "report.md").write_text("old")
    claim_folder(tmp_path, PROGRAM, "second")
    assert json.loads((tmp_path / MARKER).read_text())["command"] == "second"


@pytest.mark.parametrize("marker", [None, "", "[]", '{"made_by": "another"}'])
def test_folder_with_foreign_files_is_rejected_and_unchanged(tmp_path, marker):
    (tmp_path / "thesis.txt").write_text("mine")
    if marker is not None:
        (tmp_path / MARKER).write_text(marker)
    before = sorted(path.name for path in tmp_path.iterdir())
    with pytest.raises(InvalidInputError, match=str(tmp_path)):
        claim_folder(tmp_path, PROGRAM, "meshreel paper x.npz")
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_error_names_a_file_given_as_folder(tmp_path):
    (tmp_path / "report").write_text("")
    with pytest.raises(InvalidInputError, match="report is a file; name a folder"):
        claim_folder(tmp_path / "report", PROGRAM, "meshreel paper")


@pytest.mark.parametrize(
    ("name", "expected"), [("samba", "samba"), ("a/../b c", "a-..-b-c"), ("../", "sequence")]
)
def test_special_characters_of_names_are_replaced_in_file_names(name, expected):
    assert file_name(name) == expected


def test_tables_are_the_same_in_markdown_and_html(tmp_path):
    table = Table("T", ("a", "b|c"), (("x", "1 < 2"),))
    markdown = to_markdown([table], tmp_path)
    assert "| a | b\\|c |\n| --- | ---: |\n| x | 1 < 2 |" in markdown
    assert "<tr><td>x</td><td>1 &lt; 2</td></tr>" in to_html([table], "t")
