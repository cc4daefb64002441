from types import SimpleNamespace

import pytest

from meshreel.app.batch.manifest import DONE, Record
from meshreel.app.cli.batch import _row
from meshreel.app.cli.console import table_lines
from meshreel.app.cli.info import MAX_MESHES, mesh_table

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


def mesh(fps=0.0, low=(0, 0, 0), high=(1, 1, 1)):
    return SimpleNamespace(
        name="mesh", n_frames=2, n_verts=3, n_polygons=1, fps=fps, low=low, high=high
    )


@pytest.mark.parametrize(
    ("described", "ends"),
    [
        (mesh(25.0, (-1, 0, 1e3), (1, 0.25, 3e6)), ("25", "2 x 0.25 x 3e+06")),
        (mesh(0.0, None, None), ("-", "-")),
    ],
)
def test_columns_have_a_dash_when_the_rate_or_the_box_is_unknown(described, ends):
    assert mesh_table(SimpleNamespace(meshes=[described])) == [("mesh", "2", "3", "1", *ends)]


@pytest.mark.parametrize(("n_more", "last"), [(0, "mesh"), (1, "and 1 more"), (7, "and 7 more")])
def test_table_counts_meshes_beyond_the_maximum(n_more, last):
    rows = mesh_table(SimpleNamespace(meshes=[mesh()] * (MAX_MESHES + n_more)))
    assert len(rows) == MAX_MESHES + (n_more > 0)
    assert rows[-1][0].startswith(last)
