import pytest

from meshreel.app.cli.tables import table_lines, text_bar, text_width

ROWS = [[["format"], ["Alembic"]], [["meshes"], ["/root/body", "/root/cloth"]]]


def test_table_aligns_the_first_column_left_and_others_right():
    assert table_lines(ROWS, width=80) == [
        "┌────────┬─────────────┐",
        "│ format │     Alembic │",
        "│ meshes │  /root/body │",
        "│        │ /root/cloth │",
        "└────────┴─────────────┘",
    ]


def test_table_separates_headings():
    assert table_lines([[["a"], ["1"]]], ("name", "n"), width=80) == [
        "┌──────┬───┐",
        "│ name │ n │",
        "├──────┼───┤",
        "│ a    │ 1 │",
        "└──────┴───┘",
    ]


def test_table_is_ascii_when_required():
    assert table_lines([[["a"], ["1"]]], ("x", "y"), width=80, ascii_only=True) == [
        "+---+---+",
        "| x | y |",
        "+---+---+",
        "| a | 1 |",
        "+---+---+",
    ]


@pytest.mark.parametrize("width", [20, 31, 45])
def test_table_wraps_the_widest_columns_to_the_width(width):
    words = "spatial and temporal errors of all edges"
    lines = table_lines([[["STED"], [words]]], width=width)
    assert {len(line) for line in lines} == {width}
    cells = [line.split("│")[2] for line in lines[1:-1]]
    assert " ".join(" ".join(cells).split()) == words
    assert lines[1].startswith("│ STED │")


def test_table_breaks_words_that_are_wider_than_their_column():
    lines = table_lines([[["a"], ["x" * 30]]], width=20)
    assert "".join(line.split("│")[2].strip() for line in lines[1:-1]) == "x" * 30
    assert {len(line) for line in lines} == {20}


@pytest.mark.parametrize("width", [80, 24])
def test_table_aligns_characters_of_two_columns_and_none(width):
    lines = table_lines([[["歩く"], ["e\u0301" * 5]], [["a"], ["歩" * 10]]], width=width)
    assert len({text_width(line) for line in lines}) == 1
    assert text_width(lines[0]) <= width
    assert sum(line.count("歩") for line in lines) == 11


@pytest.mark.parametrize(
    ("share", "width", "bar"),
    [(1.0, 4, "████"), (0.5, 4, "██"), (0.5, 1, "▌"), (1e-9, 4, "▏"), (0.0, 4, "")],
)
def test_text_bar_has_a_resolution_of_one_eighth(share, width, bar):
    assert text_bar(share, width) == bar


@pytest.mark.parametrize(("share", "bar"), [(1.0, "####"), (0.4, "##"), (1e-9, "#"), (0.0, "")])
def test_text_bar_is_ascii_on_ascii_terminals(share, bar):
    assert text_bar(share, 4, ascii_only=True) == bar
