"""The architecture page counts lines, and its picture shows every layer."""

import runpy

import pytest

from samples.pages import ROOT

SCRIPT = runpy.run_path(str(ROOT / "docs" / "architecture_picture.py"))
lines_of, picture, with_lines = (SCRIPT[name] for name in ("lines_of", "picture", "with_lines"))
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_lines_of_a_folder_leave_out_folders_with_rows_of_their_own() -> None:
    rows = ["core", "core/reader"]
    assert lines_of("core", rows) + lines_of("core/reader", rows) == lines_of("core", ["core"])


def test_lines_name_the_row_when_it_does_not_exist() -> None:
    with pytest.raises(FileNotFoundError, match=r"a row for no\.such"):
        lines_of("no.such", [])


def test_lines_are_written_into_empty_cells() -> None:
    row = "| base | `errors` | exceptions | |"
    counted = with_lines(row)
    assert counted.startswith("| base | `errors` | exceptions | ")
    assert counted.endswith("0 |")


def test_picture_has_every_layer_and_adds_the_lines_of_parts() -> None:
    page = "\n".join(
        f"| {layer} | `{name}` | purpose | {lines} |"
        for layer, name, lines in [
            ("tools", "paper.study", "1,000"),
            ("tools", "paper", "500"),
            ("C core", "core", "70"),
        ]
    )
    drawn = picture(page)
    assert ">tools<" in drawn
    assert ">C core<" in drawn
    assert ">1,500 lines<" in drawn
    assert "paper.study" not in drawn


def test_table_of_modules_has_every_folder_of_the_package() -> None:
    folders = {path.name for path in (ROOT / "src" / "meshreel").iterdir() if path.is_dir()}
    named = {name for _, name, _, _ in SCRIPT["modules_of"](PAGE)}
    assert folders - {"__pycache__"} - named == set()
