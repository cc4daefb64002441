import pytest

from meshreel.app.cli.console import print_bars, print_notes, text_bar

SIZES = {"header": 77, "connectivity": 2786, "order": 33711, "coefficients": 26462, "empty": 0}


@pytest.mark.parametrize(
    ("share", "width", "bar"),
    [(1.0, 4, "████"), (0.5, 4, "██"), (0.5, 1, "▌"), (1e-9, 4, "▏"), (0.0, 4, "")],
)
def test_text_bar_has_a_resolution_of_one_eighth(share, width, bar):
    assert text_bar(share, width) == bar


@pytest.mark.parametrize(("share", "bar"), [(1.0, "####"), (0.4, "##"), (1e-9, "#"), (0.0, "")])
def test_text_bar_is_ascii_on_ascii_terminals(share, bar):
    assert text_bar(share, 4, ascii_only=True) == bar


@pytest.mark.parametrize("columns", [120, 80, 60, 40])
def test_bars_are_aligned_and_complete_on_narrow_terminals(monkeypatch, capsys, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    print_bars("bytes", SIZES)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= columns
    rows = [line for line in lines if " B " in line]
    assert len({len(row) for row in rows}) == 1
    for (name, size), row in zip(SIZES.items(), rows, strict=True):
        assert name in row
        assert f"{size} B" in row
        assert f"{100 * size / sum(SIZES.values()):.1f} %" in row
    n_blocks = [row.count("█") for row in rows]
    if columns >= 60:
        assert max(n_blocks) == n_blocks[2] >= 8
        assert n_blocks[3] == pytest.approx(n_blocks[2] * 26462 / 33711, abs=1)


def test_note_is_not_wrapped_without_a_terminal(capsys):
    note = "left out: " + ", ".join(f"field {number}" for number in range(40))
    print_notes([note, note])
    assert capsys.readouterr().err == f"note: {note}\n"
