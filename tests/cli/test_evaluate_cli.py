"""`meshreel evaluate`: reports and errors."""

import json

import pytest

import meshreel
from meshreel.evaluation.recorded import COLUMNS
from meshreel.model.flag import simulate_flag
from samples import commands
from samples.commands import assert_fails
from samples.pages import ROOT


def run(*arguments, cwd=None):
    """Run `meshreel evaluate ARGUMENTS`, and return the result."""
    return commands.run("evaluate", *arguments, cwd=cwd)


@pytest.fixture
def grid(tmp_path):
    meshreel.save(simulate_flag(5, n_rows=6, n_columns=7), tmp_path / "grid.npz")
    return tmp_path / "grid.npz"


def test_evaluate_writes_a_report(grid, tmp_path):
    rows = [",".join(COLUMNS), "flag,42,5,60,famc,q=1,60,10,2.3,0.5,0.01,1,1,0.005"]
    (tmp_path / "rd.csv").write_text("\n".join(rows))
    options = ("--methods", "v2v", "--peers", "draco,npz", "--quick", "--reference", "rd.csv")
    done = run("grid.npz", *options, "--out", "codecs", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (sequence,) = json.loads(done.stdout)["sequences"]
    assert {result["codec"] for result in sequence["measured"]} == {"v2v", "draco", "npz"}
    assert [point["codec"] for point in sequence["recorded"]] == ["famc (recorded)"]
    command = (
        "meshreel evaluate grid.npz --out codecs --methods v2v --peers draco,npz "
        "--reference rd.csv --quick"
    )
    assert command in (tmp_path / "codecs" / "report.md").read_text()
    assert all((tmp_path / name).stat().st_size > 5000 for name in sequence["figures"])


def test_evaluate_measures_a_codec_of_the_user(grid, tmp_path):
    (tmp_path / "mine.py").write_text((ROOT / "examples" / "own_codec.py").read_text())
    options = ("--methods", "v2v", "--peers", "none", "--codec", "mine:encode,decode", "--quick")
    done = run("grid.npz", *options, "--out", "codecs", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (sequence,) = json.loads(done.stdout)["sequences"]
    assert {result["codec"] for result in sequence["measured"]} == {"v2v", "mine"}
    report = (tmp_path / "codecs" / "report.md").read_text()
    assert "--codec mine:encode,decode" in report
    assert "| mine setting 12 |" in report


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--codec", "mine"), "not of the form module:encode,decode"),
        (("--methods", "pca-x"), "method 'pca-x' is unknown; choose from pca-qp"),
        (("--peers", "zip"), "peer 'zip' is unknown; choose from draco"),
        (("--methods", ","), "name at least one method"),
        (("--reference", "missing.csv"), "missing.csv"),
    ],
)
def test_evaluate_fails_with_one_line_when_an_option_is_invalid(grid, tmp_path, options, message):
    done = run(grid, *options, "--out", tmp_path / "r")
    assert_fails(done, message)
    assert not (tmp_path / "r").exists()


def test_evaluate_keeps_the_report_of_another_command(grid, tmp_path):
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / "meshreel-paper.json").write_text('{"made_by": "meshreel paper"}')
    done = run(grid, "--out", tmp_path / "r")
    assert done.returncode == 1
    assert "no meshreel-evaluate.json of an earlier run" in done.stderr


def test_error_for_changing_faces_says_what_measures_them(tmp_path):
    for name, rows in (("a", 6), ("b", 5)):
        flag = simulate_flag(2, n_rows=rows, n_columns=7)
        meshreel.save(flag, tmp_path / "frames" / f"{name}_%d.ply")
    done = run("frames", "--out", "codecs", cwd=tmp_path)
    assert_fails(
        done, "4 frames in 2 segments", "run `meshreel register` first", "meshreel compare"
    )
