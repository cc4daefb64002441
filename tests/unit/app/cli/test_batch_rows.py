import pytest

from meshreel.app.batch.manifest import DONE, Record
from meshreel.app.cli.batch import _row


@pytest.mark.parametrize(
    ("figures", "words"),
    [
        ({}, ("0 B", "0 B", "-", "-", "-", "-")),
        (
            {"raw_size_bytes": 2000, "size_bytes": 400, "ratio": 5.0, "kg_error_percent": 0.12345,
             "max_error_percent": 0.5, "seconds": 1.25},
            ("2 kB", "400 B", "5.0 x", "0.1235", "0.5000", "1.2"),
        ),
    ],
)  # fmt: skip
def test_rows_have_a_dash_for_unknown_figures(figures, words):
    assert _row("walk", Record(DONE, "x.reel", True, "", {}, **figures)) == ("walk", *words)
