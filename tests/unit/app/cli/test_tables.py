import pytest

from meshreel.app.cli.tables import table_lines, text_bar

ROWS = [[["format"], ["Alembic"]], [["meshes"], ["/root/body", "/root/cloth"]]]


def test_table_aligns_columns_left():
    assert list(table_lines(ROWS)) == [
        "format  Alembic",
        "meshes  /root/body",
        "        /root/cloth",
    ]


def test_table_with_headings_aligns_figures_right():
    assert list(table_lines([[["a"], ["12"]], [["bc"], ["3"]]], ("name", "number"))) == [
        "name  number",
        "a         12",
        "bc         3",
    ]


def test_table_aligns_characters_of_two_columns_and_none():
    rows = [[["歩く"], ["e\u0301"], ["1"]], [["abcd"], ["f"], ["2"]]]
    assert list(table_lines(rows)) == ["歩く  e\u0301  1", "abcd  f  2"]


@pytest.mark.parametrize(
    ("share", "width", "bar"),
    [(1.0, 4, "████"), (0.5, 4, "██"), (0.5, 1, "▌"), (1e-9, 4, "▏"), (0.0, 4, "")],
)
def test_text_bar_has_a_resolution_of_one_eighth(share, width, bar):
    assert text_bar(share, width) == bar


@pytest.mark.parametrize(("share", "bar"), [(1.0, "####"), (0.4, "##"), (1e-9, "#"), (0.0, "")])
def test_text_bar_is_ascii_on_ascii_terminals(share, bar):
    assert text_bar(share, 4, ascii_only=True) == bar
