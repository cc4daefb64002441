"""All example scripts and notebooks run."""

import ast
import json
import runpy
import shutil
import sys

import numpy as np
import pytest

import meshreel
from samples.pages import ROOT

EXAMPLES = ROOT / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


def code_cells(notebook):
    content = json.loads(notebook.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in content["cells"] if cell["cell_type"] == "code"]


def run_cell(code, names):
    """Run a cell and, like a notebook, represent its last expression."""
    parsed = ast.parse(code)
    last = parsed.body[-1]
    is_shown = isinstance(last, ast.Expr) and not code.rstrip().endswith(";")
    if is_shown:
        parsed.body.pop()
    exec(compile(parsed, "cell", "exec"), names)
    if is_shown:
        shown = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
        show = getattr(shown, "_repr_html_", shown.__repr__)
        assert shown is None or show()


def run_script(name, monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(notebook, tmp_path, monkeypatch):
    plots = pytest.importorskip("matplotlib.pyplot", reason="the extra `plot` is not installed")
    pytest.importorskip("h5py", reason="the extra `hdf` is not installed")
    plots.switch_backend("agg")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    for code in code_cells(notebook):
        run_cell(code, names)
    plots.close("all")


def test_notebooks_are_stored_without_their_output():
    for notebook in NOTEBOOKS:
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)


def test_archived_sequences_are_within_the_error_bound(tmp_path, monkeypatch, capsys):
    flag = meshreel.simulate_flag(12, n_rows=12, n_columns=16)
    (tmp_path / "captures").mkdir()
    meshreel.save(flag, tmp_path / "captures" / "one.npz")
    shutil.copy(tmp_path / "captures" / "one.npz", tmp_path / "captures" / "two.npz")
    out = tmp_path / "archive"
    run_script("archive.py", monkeypatch, tmp_path / "captures", out, "--max-error", "0.05")
    assert "largest error" in capsys.readouterr().out
    for name in ("one", "two"):
        assert meshreel.compare(flag, out / f"{name}.reel").max_error_percent <= 0.05
    assert len((out / "archive.csv").read_text().splitlines()) == 3


@pytest.mark.slow
def test_a_live_recording_is_readable_while_it_is_written(tmp_path, monkeypatch, capsys):
    run_script("record.py", monkeypatch, tmp_path / "a.reel", "--seconds", "2.5")
    assert "can be read already" in capsys.readouterr().out
    with meshreel.open(tmp_path / "a.reel") as reel:
        assert len(reel) == 62
        assert np.isfinite(reel[61]).all()


def test_errors_of_a_rate_distortion_table_fall_as_sizes_grow(tmp_path, monkeypatch, capsys):
    meshreel.save(meshreel.simulate_flag(12, n_rows=12, n_columns=16), tmp_path / "flag.npz")
    run_script("rate_distortion.py", monkeypatch, tmp_path / "flag.npz", "--qualities", "60,75,90")
    rows = [line.split() for line in capsys.readouterr().out.splitlines()[2:]]
    sizes, errors = ([float(row[column]) for row in rows] for column in (1, 3))
    assert sizes == sorted(sizes)
    assert errors == sorted(errors, reverse=True)
